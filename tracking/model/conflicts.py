"""Conflict sets O(v) of places that exclude each other (paper II.B), and their rows in the program."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import BOX_SIDES, dice_overlap, total_corner_distance
from tracking.model.observations import ObservationArrays
from tracking.model.settings import CostSettings

Bools = NDArray[np.bool_]


def conflict_relation(places: ObservationArrays, settings: CostSettings) -> Bools:
    """Return which places of a frame conflict, shape (M, P K, P K), symmetric, each with itself.

    Places are numbered `p K + i`. Padding conflicts with nothing, not even with itself.
    """
    sets, frames, width = places.present.shape
    boxes = np.swapaxes(places.boxes, 0, 1).reshape(frames, sets * width, BOX_SIDES)
    present = np.swapaxes(places.present, 0, 1).reshape(frames, sets * width)
    relation = np.empty((frames, sets * width, sets * width), dtype=np.bool_)
    for m in range(frames):
        pair = boxes[m, :, None], boxes[m, None]
        if settings.conflict_rule == "corners":
            relation[m] = total_corner_distance(*pair) < settings.conflict_distance
        else:
            relation[m] = dice_overlap(*pair) > settings.conflict_overlap
        np.fill_diagonal(relation[m], val=True)
    return relation & present[:, :, None] & present[:, None]


def clique_rows(relation: Bools, owners: NDArray[np.int64] | None) -> Bools:
    """Cover the conflicts of one frame by cliques: (R, V) bool, at most one path through each row.

    `relation` is (V, V); `owners` (V,) is the object of each place, None if all objects share them. Each
    conflicting pair of places of two objects is contained in a row. Places of one object can be in a clique
    together, since an object takes only one place. The covers of connected components are independent.
    """
    joined, uncovered = relation.copy(), relation.copy()
    if owners is not None:
        own = owners[:, None] == owners
        present = relation.diagonal()
        joined |= own & present[:, None] & present
        uncovered &= ~own
    if len(relation) and uncovered.any() and joined.all():
        return np.ones((1, len(relation)), dtype=np.bool_)
    rows = []
    for first in range(len(relation)):
        while uncovered[first].any():
            row = _grow_clique(first, int(uncovered[first].argmax()), joined, uncovered)
            uncovered[np.ix_(row, row)] = False
            rows.append(row)
    return np.array(rows).reshape(len(rows), len(relation))


def connected_component(relation: Bools, place: int) -> NDArray[np.int64]:
    """Return the places of a frame that `place` conflicts with, directly or through others, ascending."""
    reached = relation[place]
    while True:
        further = relation[reached].any(axis=0)
        if (further == reached).all():
            return np.flatnonzero(reached)
        reached = further


def _grow_clique(first: int, second: int, joined: Bools, uncovered: Bools) -> Bools:
    """Grow a clique from two places, adding those that cover most uncovered pairs first."""
    row = np.zeros(len(joined), dtype=np.bool_)
    row[[first, second]] = True
    candidates = joined[first] & joined[second] & ~row
    while candidates.any():
        gain = uncovered[:, row].sum(axis=1)
        gain[~candidates] = -1
        best = int(gain.argmax())
        row[best] = True
        candidates &= joined[best]
        candidates[best] = False
    return row


def star_exclusions(relation: Bools, sets: int, objects: int) -> Bools:
    """Return which places two objects cannot both take if the rows are stars, (M, P K, P K).

    With the rows exactly as in II.D, two places also exclude each other if both conflict with one place of a
    third object.
    """
    if objects <= 2:  # noqa: PLR2004 — there is no third object
        return relation
    step = relation.copy()
    if sets > 1:
        width = relation.shape[1] // sets
        for p in range(sets):
            own = slice(p * width, (p + 1) * width)
            step[:, own, own] = False
    counts = step.astype(np.float64)
    return relation | (counts @ counts > 0.0)
