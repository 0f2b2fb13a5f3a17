"""Tracks into persons: one assignment over all cameras, from evidence between pairs of tracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

_FORBIDDEN = -1e6
_VACANT = 0.01
"""What an otherwise empty person is worth to a track: more than a new one, so that numbers are kept."""
_OWN = 0.02
"""What staying is worth to a track that nothing else holds."""
_SWEEPS = 4
"""Rounds over the cameras; the total rises with every step, and three rounds settle all but odd cases."""


@dataclass(frozen=True, slots=True)
class GroupingProblem:
    """T tracks, each with a camera and a person so far, and what is known about pairs of them.

    Attributes:
        evidence: (T, T) symmetric; above 0: the same person; within a camera only between a lost track
            and its heir.
        rivals: (T, T) bool, the two were seen at the same time in one camera: two people.
        camera: (T,) camera index.
        person: (T,) person so far, any integers >= 0.
        present: (T,) bool, seen just now: only these move, and only these speak.
        hold: (T,) evidence against that it takes to part the track from its person.
        join: evidence that lets a track join a person.
    """

    evidence: NDArray[np.float64]
    rivals: NDArray[np.bool_]
    camera: NDArray[np.int64]
    person: NDArray[np.int64]
    present: NDArray[np.bool_]
    hold: NDArray[np.float64]
    join: float


def group(problem: GroupingProblem) -> NDArray[np.int64]:
    """Improve the grouping of tracks into persons: (T,) persons; new ones get integers above the given.

    Maximises the evidence within persons, with `hold` and `join` as hysteresis, such that no two
    tracks seen at once in one camera are one person. One camera's tracks are assigned to the persons
    at a time, optimally and one to one (Hungarian method), given the other cameras', until nothing
    moves; then persons that belong together as a whole are merged. Deterministic.
    """
    person = problem.person.copy()
    for _ in range(_SWEEPS):
        before = person.copy()
        for camera in np.unique(problem.camera[problem.present]):
            _assign_camera(problem, int(camera), person)
        _merge_wholes(problem, person)
        if np.array_equal(person, before):
            break
    return person


def _assign_camera(problem: GroupingProblem, camera: int, person: NDArray[np.int64]) -> None:
    """Assign one camera's present tracks to the persons, best in total; changes `person` in place."""
    rows = np.flatnonzero(problem.present & (problem.camera == camera))
    others = np.flatnonzero(problem.present & (problem.camera != camera))
    known = np.unique(person)
    member = person[:, None] == known[None, :]
    support = problem.evidence[np.ix_(rows, others)] @ member[others].astype(np.float64)
    inhabited = np.broadcast_to(member[others].any(axis=0), support.shape)
    # What was lost in this camera speaks for its heirs.
    hidden = np.flatnonzero(~problem.present & (problem.camera == camera))
    heirs = problem.evidence[np.ix_(rows, hidden)] @ member[hidden].astype(np.float64)
    support, inhabited = support + heirs, inhabited | (heirs > 0)
    score = np.where(inhabited, support - problem.join, _VACANT - _never_mine(rows, person, known))
    mine = member[rows]
    score = np.where(mine, support + problem.hold[rows][:, None] + _OWN, score)
    # A rival that is hidden just now still is somebody else.
    taken = problem.rivals[np.ix_(rows, hidden)].astype(np.float64) @ member[hidden].astype(np.float64) > 0
    score = np.where(taken & ~mine, _FORBIDDEN, score)
    # One new person for each track, worth nothing.
    alone = np.where(np.eye(rows.size, dtype=bool), 0.0, _FORBIDDEN)
    row, column = linear_sum_assignment(np.concatenate([score, alone], axis=1), maximize=True)
    fresh = int(person.max()) + 1
    for i, j in zip(row, column, strict=True):
        if j < known.size:
            person[rows[i]] = known[j]
        else:
            person[rows[i]] = fresh
            fresh += 1


def _never_mine(
    rows: NDArray[np.int64], person: NDArray[np.int64], known: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Bar the way to persons nobody of this camera comes from: an absent one is not taken by chance."""
    return np.where(np.isin(known, person[rows]), 0.0, -_FORBIDDEN)


def _merge_wholes(problem: GroupingProblem, person: NDArray[np.int64]) -> None:
    """Merge persons whose tracks as a whole belong together, strongest first; changes `person`."""
    shown = np.flatnonzero(problem.present)
    same_camera = problem.camera[:, None] == problem.camera[None, :]
    at_once = same_camera & problem.present[:, None] & problem.present[None, :]
    apart = (problem.rivals | at_once).astype(np.float64)
    while True:
        known = np.unique(person[shown])
        every = (person[:, None] == known[None, :]).astype(np.float64)
        here = every[shown]
        gain = here.T @ problem.evidence[np.ix_(shown, shown)] @ here
        # What holds a person is its best held track; the less held of two persons has to give way.
        held = np.where(here > 0, problem.hold[shown][:, None], 0.0).max(axis=0, initial=0.0)
        gain -= problem.join + np.minimum(held[:, None], held[None, :])
        gain[every.T @ apart @ every > 0] = _FORBIDDEN
        gain[np.tril_indices(known.size)] = _FORBIDDEN
        if not gain.size or gain.max() <= 0:
            return
        keep, lose = np.unravel_index(int(np.argmax(gain)), gain.shape)
        person[person == known[lose]] = known[keep]
