"""A track that begins where another one of the same camera was lost a moment ago is probably its heir."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.evidence import TrackKey
from bestview.ground import feet

_START_HEIGHTS, _SPEED_HEIGHTS = 0.35, 0.04
"""Reach in the picture, in box heights: at once, and per frame."""

_RATIO = 2.0
"""How many times further off the next candidate must be for the nearest to be taken."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where somebody was seen: frame, (4,) box in pixels, (2,) ground point (NaN: unknown)."""

    frame: int
    box: NDArray[np.float64]
    ground: NDArray[np.float64]


def picture_cost(new: Place, old: Place) -> float:
    """Distance between feet in one camera's picture, in units of what is plausible in the time between."""
    return float(picture_costs([new], [old])[0])


def picture_costs(new: Sequence[Place], old: Sequence[Place]) -> NDArray[np.float64]:
    """Give the same for N pairs of places: (N,)."""
    after, before = (np.array([place.box for place in places]).reshape(-1, 4) for places in (new, old))
    apart = np.hypot(*(feet(after) - feet(before)).T)
    height = np.maximum(np.maximum(before[:, 3] - before[:, 1], after[:, 3] - after[:, 1]), 1.0)
    gap = np.array([max(n.frame - o.frame, 0) for n, o in zip(new, old, strict=True)])
    return np.asarray(apart / height / (_START_HEIGHTS + _SPEED_HEIGHTS * gap))


def clearly_least(cost: NDArray[np.float64], ratio: float) -> NDArray[np.bool_]:
    """Where a finite entry is the least of its row and column, and the next is `ratio` times as large.

    NaN and infinite entries do not compete.
    """
    filled = np.where(np.isnan(cost), np.inf, cost)
    clear = np.isfinite(filled)
    for axis in (0, 1):
        if cost.shape[axis] > 1:
            two = np.sort(filled, axis=axis)
            least, second = np.take(two, [0], axis=axis), np.take(two, [1], axis=axis)
            clear &= (filled == least) & (second >= ratio * least)
    return clear


@dataclass(frozen=True, slots=True)
class Heir:
    """`heir` probably is who `lost` was; the score in (0, 1] says how well the places fit."""

    heir: TrackKey
    lost: TrackKey
    score: float


class Heirs:
    """Watches every camera's tracks begin and end.

    Args:
        continuity: frames within which a lost track can have an heir.
    """

    def __init__(self, continuity: int) -> None:
        self._continuity = continuity
        self._first: dict[TrackKey, Place] = {}
        self._last: dict[TrackKey, Place] = {}
        self._lost_of: dict[TrackKey, TrackKey] = {}

    def update(
        self, keys: Sequence[TrackKey], sighted: Mapping[TrackKey, tuple[Place, Place]], since: int
    ) -> list[Heir]:
        """Take in where the tracks were first and last seen in a window; return the heirs found.

        A track that began at `since` or later follows a lost one when each is by far the other's
        nearest in the picture. A track has one heir at most and is one's at most.

        Args:
            keys: the tracks to remember; others are forgotten.
            sighted: first and last place in the window.
            since: first frame of the window.
        """
        for key, (first, last) in sighted.items():
            self._first.setdefault(key, first)
            self._last[key] = last
        self._first = {key: self._first[key] for key in keys if key in self._first}
        self._last = {key: self._last[key] for key in self._first}
        self._lost_of = {heir: lost for heir, lost in self._lost_of.items() if heir in self._first}
        begun = {
            key.camera
            for key, place in self._first.items()
            if place.frame >= since and key not in self._lost_of
        }
        mine: dict[str, list[TrackKey]] = {camera: [] for camera in sorted(begun)}
        for key in self._first:
            if key.camera in mine:
                mine[key.camera].append(key)
        taken = set(self._lost_of.values())
        return [heir for here in mine.values() for heir in self._find(here, taken, since)]

    def _find(self, mine: list[TrackKey], taken: set[TrackKey], since: int) -> list[Heir]:
        new = [key for key in mine if key not in self._lost_of and self._first[key].frame >= since]
        lost = [key for key in mine if key not in taken]
        begins = [self._first[key] for key in new]
        ends = [self._last[key] for key in lost]
        cost = np.full((len(new), len(lost)), np.inf)
        gap = np.array([p.frame for p in begins])[:, None] - np.array([p.frame for p in ends])[None, :]
        i, j = np.nonzero((gap > 0) & (gap <= self._continuity))
        cost[i, j] = picture_costs([begins[k] for k in i.tolist()], [ends[k] for k in j.tolist()])
        found = []
        for i, j in zip(*np.nonzero(clearly_least(cost, _RATIO) & (cost < 1)), strict=True):
            self._lost_of[new[i]] = lost[j]
            found.append(Heir(new[i], lost[j], 1.0 - float(cost[i, j]) ** 2))
        return found
