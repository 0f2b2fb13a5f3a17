"""Identity by square tables over all tracks, as its formulas read: what the library's must be equal to."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from bestview.evidence import TrackKey
from bestview.likeness import WORST
from bestview.sightings import Sightings
from bestview.strangers import MIN_COMMON_FRAMES, counted, exact

FORBIDDEN = -1e6
VACANT, OWN = 0.01, 0.02
SWEEPS = 4

Table = NDArray[np.float64]
Mask = NDArray[np.bool_]


def distances(seen: Sightings, gate: float) -> Table:
    """Mean distance on the ground in gates of all pairs: (T, T), NaN: seen together in too few frames."""
    tracks, frames = seen.ground.shape[:2]
    total, count = np.zeros((tracks, tracks)), np.zeros((tracks, tracks))
    for frame in range(frames):
        at, spread = seen.ground[:, frame], seen.spread[:, frame]
        dx, dy = (at[:, None, axis] - at[None, :, axis] for axis in (0, 1))
        xx, xy, yy = (spread[:, None, i, j] + spread[None, :, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
        xx, yy = xx + gate**2, yy + gate**2
        squared = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
        known = ~np.isnan(squared)
        total += np.where(known, np.sqrt(np.maximum(squared, 0.0)), 0.0)
        count += known
    return np.where(count >= MIN_COMMON_FRAMES, total / np.maximum(count, 1), np.nan)


def ground_scores(seen: Sightings, present: Mask, gate: float) -> Table:
    """(T, T) scores by ground of the tracks present in different cameras; NaN: nothing learned."""
    camera = np.array([key.camera for key in seen.keys])
    scores = np.maximum(1.0 - distances(seen, gate) ** 2, WORST)
    scores[(camera[:, None] == camera[None, :]) | ~(present[:, None] & present[None, :])] = np.nan
    return scores


class RivalTable:
    """(T, T) who was seen side by side."""

    def __init__(self, table: Mask) -> None:
        self.table = table

    def any_between(self, ones: NDArray[np.int64], others: NDArray[np.int64]) -> bool:
        return bool(self.table[np.ix_(ones, others)].any())


class DensePairs:
    """Evidence as a square table over the tracks in play."""

    def __init__(self) -> None:
        self.keys: tuple[TrackKey, ...] = ()
        self.evidence: Table = np.zeros((0, 0))
        self.rivals = RivalTable(np.zeros((0, 0), dtype=bool))

    def follow(self, keys: Sequence[TrackKey]) -> None:
        place = {key: i for i, key in enumerate(self.keys)}
        new = np.array([i for i, key in enumerate(keys) if key in place], dtype=np.int64)
        old = np.array([place[key] for key in keys if key in place], dtype=np.int64)
        evidence = np.zeros((len(keys), len(keys)))
        rivals = np.zeros((len(keys), len(keys)), dtype=bool)
        evidence[np.ix_(new, new)] = self.evidence[np.ix_(old, old)]
        rivals[np.ix_(new, new)] = self.rivals.table[np.ix_(old, old)]
        self.keys, self.evidence, self.rivals = tuple(keys), evidence, RivalTable(rivals)

    def rows(self, keys: Iterable[TrackKey]) -> NDArray[np.int64]:
        place = {key: i for i, key in enumerate(self.keys)}
        return np.array([place[key] for key in keys], dtype=np.int64)

    def in_play(self, keys: Iterable[TrackKey]) -> NDArray[np.int64]:
        return self.rows(sorted(set(keys) & set(self.keys)))

    def add(
        self, rows: NDArray[np.int64], scores: Table, side_by_side: Mask, memory: float, cap: float
    ) -> None:
        where = np.ix_(rows, rows)
        before = self.evidence[where]
        after = counted(before, np.nan_to_num(scores), memory, cap)
        self.evidence[where] = np.where(np.isnan(scores), before, after)
        self.rivals.table[where] |= side_by_side

    def inherit(self, heir: TrackKey, lost: TrackKey, evidence: float) -> None:
        i, j = self.rows([heir, lost])
        if not self.rivals.table[i, j]:
            self.evidence[i, j] = self.evidence[j, i] = exact(np.array(evidence))


@dataclass(frozen=True)
class DenseProblem:
    """A grouping problem by (T, T) evidence and (T, T) rivals."""

    evidence: Table
    rivals: Mask
    camera: NDArray[np.int64]
    person: NDArray[np.int64]
    present: Mask
    hold: Table
    join: float


def group(problem: DenseProblem) -> NDArray[np.int64]:
    """Improve the grouping, every camera against every person in each sweep."""
    person = problem.person.copy()
    for _ in range(SWEEPS):
        before = person.copy()
        for camera in np.unique(problem.camera[problem.present]):
            assign_camera(problem, int(camera), person)
        merge_wholes(problem, person)
        if np.array_equal(person, before):
            break
    return person


def assign_camera(problem: DenseProblem, camera: int, person: NDArray[np.int64]) -> None:
    rows = np.flatnonzero(problem.present & (problem.camera == camera))
    others = np.flatnonzero(problem.present & (problem.camera != camera))
    known = np.unique(person)
    member = person[:, None] == known[None, :]
    support = problem.evidence[np.ix_(rows, others)] @ member[others].astype(np.float64)
    inhabited = np.broadcast_to(member[others].any(axis=0), support.shape)
    hidden = np.flatnonzero(~problem.present & (problem.camera == camera))
    heirs = problem.evidence[np.ix_(rows, hidden)] @ member[hidden].astype(np.float64)
    support, inhabited = support + heirs, inhabited | (heirs > 0)
    never_mine = np.where(np.isin(known, person[rows]), 0.0, FORBIDDEN)
    score = np.where(inhabited, support - problem.join, VACANT + never_mine)
    mine = member[rows]
    score = np.where(mine, support + problem.hold[rows][:, None] + OWN, score)
    taken = problem.rivals[np.ix_(rows, hidden)].astype(np.float64) @ member[hidden].astype(np.float64) > 0
    score = np.where(taken & ~mine, FORBIDDEN, score)
    # Ties are settled among those whom somebody wants.
    wanted = score.max(axis=0) >= 0
    known, score = known[wanted], score[:, wanted]
    alone = np.where(np.eye(rows.size, dtype=bool), 0.0, FORBIDDEN)
    row, column = linear_sum_assignment(np.concatenate([score, alone], axis=1), maximize=True)
    fresh = int(max(person.max(), problem.person.max())) + 1
    for i, j in zip(row, column, strict=True):
        if j < known.size:
            person[rows[i]] = known[j]
        else:
            person[rows[i]] = fresh
            fresh += 1


def merge_wholes(problem: DenseProblem, person: NDArray[np.int64]) -> None:
    shown = np.flatnonzero(problem.present)
    same_camera = problem.camera[:, None] == problem.camera[None, :]
    at_once = same_camera & problem.present[:, None] & problem.present[None, :]
    apart = (problem.rivals | at_once).astype(np.float64)
    while True:
        known = np.unique(person[shown])
        every = (person[:, None] == known[None, :]).astype(np.float64)
        here = every[shown]
        gain = here.T @ problem.evidence[np.ix_(shown, shown)] @ here
        held = np.where(here > 0, problem.hold[shown][:, None], 0.0).max(axis=0, initial=0.0)
        gain -= problem.join + np.minimum(held[:, None], held[None, :])
        gain[every.T @ apart @ every > 0] = FORBIDDEN
        gain[np.tril_indices(known.size)] = FORBIDDEN
        if not gain.size or gain.max() <= 0:
            return
        keep, lose = np.unravel_index(int(np.argmax(gain)), gain.shape)
        person[person == known[lose]] = known[keep]
