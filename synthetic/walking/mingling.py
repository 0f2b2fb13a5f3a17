"""People who never leave: their rounds, joined and rounded off to poses at any moment.

A round is a pure function of its number, so any moment can be asked for at once, in any process.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.drawing.skeleton import STRIDE
from synthetic.walking.gait import whole
from synthetic.walking.paths import ROUND, Choreography, Way, compared
from synthetic.walking.stroll import ROUNDING, SAMPLES_PER_SECOND, TURNING, Pose, Stroll, soften

_AROUND = 2.0  # seconds before and after a round that its corners are rounded with
_SWAY = 0.10  # radians by which who stands turns to and fro
_SWAY_SECONDS = 3.7
_WALK = 1.5  # metres per second from which steps grow longer, not only quicker
_LONGER = 0.35  # by which they do so per metre per second


class Mingle:
    """The company of a room; walker 0 is object 1.

    Args:
        rounds: where everybody goes.
        heights: of everybody, metres: how long their steps are.
    """

    def __init__(self, rounds: Choreography, heights: Sequence[float]) -> None:
        self._strides = [STRIDE * height for height in heights]
        self._strolls = lru_cache(maxsize=4)(self._walk)
        self._ways = lru_cache(maxsize=8)(rounds.ways)

    def poses(self, seconds: float) -> list[Pose]:
        """Give everybody's pose at a moment of the scene."""
        number = int(seconds // ROUND)
        return [stroll.at(seconds - number * ROUND) for stroll in self._strolls(number)]

    def _walk(self, number: int) -> list[Stroll]:
        rounds = [self._ways(number + step) for step in (-1, 0, 1)]
        return [
            _stroll([ways[walker] for ways in rounds], stride, number * ROUND + 1.3 * walker)
            for walker, stride in enumerate(self._strides)
        ]


def _stroll(ways: list[Way], stride: float, since: float) -> Stroll:
    """Walk the middle one of three rounds: corners are cut from one round into the next, too."""
    spare = int(_AROUND * SAMPLES_PER_SECOND)
    inner = int(ROUND * SAMPLES_PER_SECOND) + 1
    clock = (np.arange(inner + 2 * spare) - spare) / SAMPLES_PER_SECOND
    starts = [-ROUND, 0.0, ROUND]
    # A round's last key frame is the next one's first: kept once.
    times = np.concatenate([way.times[:-1] + start for way, start in zip(ways, starts, strict=True)])
    places = np.concatenate([way.places[:-1] for way in ways])
    faces = np.unwrap(np.concatenate([way.faces[:-1] for way in ways]))
    straight = np.column_stack([np.interp(clock, times, axis) for axis in places.T])
    way = np.column_stack([soften(axis, ROUNDING) for axis in (straight + _bends(ways, clock)).T])
    headings = soften(faces[np.searchsorted(times, clock, side="right") - 1], TURNING)
    steps = np.hypot(*np.diff(way, axis=0, prepend=way[:1]).T)
    kept = slice(spare, spare + inner)
    speeds = steps[kept] * SAMPLES_PER_SECOND
    paces = steps[kept] / (1 + _LONGER * np.maximum(speeds - _WALK, 0))
    calm = np.clip(1 - speeds / 0.4, 0, 1)
    sway = _SWAY * np.sin(2 * np.pi * (clock[kept] + since) / _SWAY_SECONDS)
    return Stroll(way[kept], headings[kept] + calm * sway, whole(paces, stride), speeds)


def _bends(ways: list[Way], clock: Floats) -> Floats:
    """Give how far three rounds' ways are bent: ``(T, 2)`` metres."""
    aside = np.concatenate([way.aside[:-1] for way in ways])
    moments = np.concatenate([compared()[:-1] + start for start in (-ROUND, 0.0, ROUND)])
    return np.column_stack([np.interp(clock, moments, axis) for axis in aside.T])
