"""A crowd that never leaves: planned rounds of paths, joined and smoothed to poses at any moment.

A round is a pure function of its number, so any moment can be drawn at once, in any process.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.drawing.skeleton import STRIDE
from synthetic.walking.round_paths import ROUND, Choreography, RoundPath, sample_times
from synthetic.walking.trajectory import (
    ROUNDING,
    SAMPLES_PER_SECOND,
    TURNING,
    Pose,
    Trajectory,
    smooth,
    whole_strides,
)

_AROUND = 2.0  # seconds before and after a round that smoothing needs
_SWAY = 0.10  # radians by which standing people turn to and fro
_SWAY_SECONDS = 3.7
_WALK = 1.5  # meters per second from which steps grow longer, not only quicker
_LONGER = 0.35  # by which they do so per meter per second


class ChoreographedCrowd:
    """The people of a room, moved round by round; walker 0 is object 1.

    Args:
        rounds: where everybody goes.
        heights: of everybody, meters: how long their steps are.
    """

    def __init__(self, rounds: Choreography, heights: Sequence[float]) -> None:
        self._strides = [STRIDE * height for height in heights]
        self._trajectories = lru_cache(maxsize=4)(self._walk)
        self._paths = lru_cache(maxsize=8)(rounds.paths)

    def poses(self, seconds: float) -> list[Pose]:
        """Return everybody's pose at a moment of the scene."""
        number = int(seconds // ROUND)
        return [trajectory.at(seconds - number * ROUND) for trajectory in self._trajectories(number)]

    def _walk(self, number: int) -> list[Trajectory]:
        rounds = [self._paths(number + step) for step in (-1, 0, 1)]
        return [
            _trajectory([paths[walker] for paths in rounds], stride, number * ROUND + 1.3 * walker)
            for walker, stride in enumerate(self._strides)
        ]


def _trajectory(paths: list[RoundPath], stride: float, since: float) -> Trajectory:
    """Build the trajectory of the middle one of three rounds; it is smoothed across the rounds' ends."""
    spare = int(_AROUND * SAMPLES_PER_SECOND)
    inner = int(ROUND * SAMPLES_PER_SECOND) + 1
    clock = (np.arange(inner + 2 * spare) - spare) / SAMPLES_PER_SECOND
    starts = [-ROUND, 0.0, ROUND]
    # A round's last key frame is the next one's first: kept once.
    times = np.concatenate([path.times[:-1] + start for path, start in zip(paths, starts, strict=True)])
    places = np.concatenate([path.places[:-1] for path in paths])
    facing = np.unwrap(np.concatenate([path.facing[:-1] for path in paths]))
    straight = np.column_stack([np.interp(clock, times, axis) for axis in places.T])
    path = np.column_stack([smooth(axis, ROUNDING) for axis in (straight + _bends(paths, clock)).T])
    headings = smooth(facing[np.searchsorted(times, clock, side="right") - 1], TURNING)
    steps = np.hypot(*np.diff(path, axis=0, prepend=path[:1]).T)
    kept = slice(spare, spare + inner)
    speeds = steps[kept] * SAMPLES_PER_SECOND
    paces = steps[kept] / (1 + _LONGER * np.maximum(speeds - _WALK, 0))
    calm = np.clip(1 - speeds / 0.4, 0, 1)
    sway = _SWAY * np.sin(2 * np.pi * (clock[kept] + since) / _SWAY_SECONDS)
    return Trajectory(path[kept], headings[kept] + calm * sway, whole_strides(paces, stride), speeds)


def _bends(paths: list[RoundPath], clock: Floats) -> Floats:
    """Return the offsets of three rounds' paths: ``(T, 2)`` meters."""
    offsets = np.concatenate([path.offsets[:-1] for path in paths])
    moments = np.concatenate([sample_times()[:-1] + start for start in (-ROUND, 0.0, ROUND)])
    return np.column_stack([np.interp(clock, moments, axis) for axis in offsets.T])
