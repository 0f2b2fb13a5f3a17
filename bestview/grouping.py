"""Tracks into persons: one assignment over all cameras, from evidence between pairs of tracks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from bestview.claims import FORBIDDEN, VACANT, Claims, claims, unsettled_cameras
from bestview.grouping_problem import GroupingProblem, Links
from bestview.merging import merge_wholes

__all__ = ["GroupingProblem", "group"]

_SWEEPS = 4
"""Rounds over the cameras; the total rises with every step, and three rounds settle all but odd cases."""


def group(problem: GroupingProblem) -> NDArray[np.int64]:
    """Improve the grouping of tracks into persons: (T,) persons; new ones get integers above the given.

    Maximises the evidence within persons, with `hold` and `join` as hysteresis, such that no two
    tracks seen at once in one camera are one person. One camera's tracks are assigned to the persons
    at a time, optimally and one to one (Hungarian method), given the other cameras', until nothing
    moves; then persons that belong together as a whole are merged. Deterministic.

    A camera none of whose tracks could do better is left out, so what this costs grows with what changes.
    """
    names, person = np.unique(problem.person, return_inverse=True)
    links = Links.of(problem.pairs)
    for _ in range(_SWEEPS):
        before = person.copy()
        _sweep(problem, links, person, names.size)
        merge_wholes(problem, links, person)
        if np.array_equal(person, before):
            break
    fresh = np.arange(person.max(initial=0) + 1 - names.size) + names.max(initial=-1) + 1
    return np.asarray(np.concatenate([names, fresh])[person])


def _sweep(problem: GroupingProblem, links: Links, person: NDArray[np.int64], given: int) -> None:
    """Assign the tracks of one camera after the other, where they may move; changes `person` in place.

    Persons from `given` on are new.
    """
    present = np.flatnonzero(problem.present)
    every = claims(problem, links, person, present)
    look, stale = unsettled_cameras(problem, every), np.zeros(int(problem.camera.max()) + 1, dtype=np.bool_)
    for camera in np.unique(problem.camera[present]).tolist():
        if not (look[camera] or stale[camera]):
            continue
        rows = present[problem.camera[present] == camera]
        found = claims(problem, links, person, rows) if stale[camera] else every.of(rows)
        if stale[camera] and not unsettled_cameras(problem, found)[camera]:
            continue
        touched = _assign_camera(problem, found, person, rows, max(given, int(person.max()) + 1))
        # Whose claims say something else now: those persons' tracks, and all that they are linked to.
        near = np.isin(person, touched)
        near[links.other[near[links.track]]] = True
        stale[problem.camera[near]] = True


def _assign_camera(
    problem: GroupingProblem,
    found: Claims,
    person: NDArray[np.int64],
    rows: NDArray[np.int64],
    fresh: int,
) -> NDArray[np.int64]:
    """Assign one camera's present tracks to the persons, best in total; changes `person` in place.

    `found` has their claims. New persons begin at `fresh`.

    Returns:
        The persons who have lost or won a track.
    """
    known, column = np.unique(found.person, return_inverse=True)
    row = np.searchsorted(rows, found.track)
    score = np.full((rows.size, known.size), FORBIDDEN)
    # Whom of this camera's persons nobody else sees may be taken over; others' absent ones are not.
    score[:, column[found.mine & ~found.seen]] = VACANT
    hidden = np.flatnonzero(~problem.present & (problem.camera == problem.camera[rows[0]]))
    hidden = hidden[np.isin(person[hidden], known)]
    # A rival that is hidden just now still is somebody else.
    one, two = np.repeat(np.arange(rows.size), hidden.size), np.tile(hidden, rows.size)
    rival = problem.pairs.rivals.between(rows[one], two)
    score[one[rival], np.searchsorted(known, person[two[rival]])] = FORBIDDEN
    score[row, column] = found.worth
    # Nobody is taken who is worth less than nothing. Left out, they do not settle ties either.
    wanted = score.max(axis=0) >= 0
    known, score = known[wanted], score[:, wanted]
    # One new person for each track, worth nothing.
    alone = np.where(np.eye(rows.size, dtype=bool), 0.0, FORBIDDEN)
    _, chosen = linear_sum_assignment(np.concatenate([score, alone], axis=1), maximize=True)
    before = person[rows]
    new = chosen >= known.size
    after = np.concatenate([known, np.zeros(rows.size, dtype=np.int64)])[chosen]
    after[new] = fresh + np.arange(int(new.sum()))
    person[rows] = after
    moved = before != after
    return np.concatenate([before[moved], after[moved]])
