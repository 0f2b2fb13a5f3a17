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
    apart = float(np.hypot(*(feet(new.box) - feet(old.box))))
    height = max(float(old.box[3] - old.box[1]), float(new.box[3] - new.box[1]), 1.0)
    return apart / height / (_START_HEIGHTS + _SPEED_HEIGHTS * max(new.frame - old.frame, 0))


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
        return [
            heir
            for camera in sorted({key.camera for key in self._first})
            for heir in self._find(camera, since)
        ]

    def _find(self, camera: str, since: int) -> list[Heir]:
        mine = [key for key in self._first if key.camera == camera]
        taken = set(self._lost_of.values())
        new = [key for key in mine if key not in self._lost_of and self._first[key].frame >= since]
        lost = [key for key in mine if key not in taken]
        cost = np.full((len(new), len(lost)), np.inf)
        for i, heir in enumerate(new):
            for j, end in enumerate(lost):
                gap = self._first[heir].frame - self._last[end].frame
                if 0 < gap <= self._continuity:
                    cost[i, j] = picture_cost(self._first[heir], self._last[end])
        found = []
        for i, j in zip(*np.nonzero(clearly_least(cost, _RATIO) & (cost < 1)), strict=True):
            self._lost_of[new[i]] = lost[j]
            found.append(Heir(new[i], lost[j], 1.0 - float(cost[i, j]) ** 2))
        return found
