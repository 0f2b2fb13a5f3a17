"""A crowd that never leaves: paths planned in rounds, joined and smoothed to poses at any moment.

A round is a pure function of its number, so any moment can be drawn directly, in any process.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.drawing.skeleton import STRIDE
from synthetic.walking.collision_avoidance import push_paths_apart
from synthetic.walking.trajectory import (
    ROUNDING,
    SAMPLES_PER_SECOND,
    TURNING,
    Pose,
    Trajectory,
    cumulate_to_whole_strides,
    smooth,
)

ROUND = 10.0  # seconds
BEFORE = 10_000  # added to numbers of rounds in seeds, which cannot be negative
_RATE = 10  # samples per second at which paths are compared


@dataclass(frozen=True, slots=True)
class RoundPath:
    """One person's path in a round: times (K,), places (K, 2) and the direction faced after each (K,)."""

    times: Floats  # seconds into the round; the first is 0 and the last is `ROUND`
    places: Floats  # meters
    facing: Floats  # radians
    sampled_offsets: Floats  # (T, 2) meters by which the path is bent at `sample_times()`

    def at(self, moments: Floats) -> Floats:
        """Return the places ``(T, 2)`` at moments ``(T,)``."""
        straight = [np.interp(moments, self.times, axis) for axis in self.places.T]
        bends = [np.interp(moments, sample_times(), axis) for axis in self.sampled_offsets.T]
        places: Floats = np.column_stack(straight) + np.column_stack(bends)
        return places


class Choreography(Protocol):
    """All paths, round by round: a round begins where the previous one ended."""

    def paths(self, number: int) -> list[RoundPath]:
        """Return the paths of a round; a pure function of its number, which may be negative."""
        ...


def sample_times() -> Floats:
    """Return the moments ``(T,)`` of a round at which paths are compared, in seconds."""
    return np.arange(int(ROUND * _RATE) + 1) / _RATE


def straight_path(times: Floats, places: Floats, facing: Floats) -> RoundPath:
    """Build a path without offsets."""
    return RoundPath(times, places, facing, np.zeros((len(sample_times()), 2)))


def heading_to(start: Floats, end: Floats) -> float:
    """Return the direction from a place ``(2,)`` to another, in radians."""
    return float(np.arctan2(end[1] - start[1], end[0] - start[0]))


def avoid_collisions(paths: Sequence[RoundPath], keep: Floats) -> tuple[RoundPath, ...]:
    """Bend paths until all pairs of people are ``(P, P)`` meters apart."""
    straight = np.array([path.at(sample_times()) for path in paths])
    bends = push_paths_apart(straight, keep, _RATE) - straight
    return tuple(replace(path, sampled_offsets=offsets) for path, offsets in zip(paths, bends, strict=True))


def crowding_cost(paths: Sequence[RoundPath], keep: Floats) -> float:
    """Return the cost of pairs nearer than ``(P, P)`` meters; 0 if there are none."""
    places = np.array([path.at(sample_times()) for path in paths])
    gaps = np.linalg.norm(places[:, None] - places[None], axis=3)
    short = np.maximum(keep[..., None] - gaps, 0)
    short[np.arange(len(paths)), np.arange(len(paths))] = 0
    return float((short**2).sum())


_AROUND = 2.0  # seconds before and after a round for smoothing
_SWAY = 0.10  # radians by which standing people turn to and fro
_SWAY_SECONDS = 3.7
_WALK = 1.5  # meters per second from which steps become longer, not only faster
_LONGER = 0.35  # growth of the steps per meter per second above that


class ChoreographedCrowd:
    """The people of a room, moved round by round; walker 0 is object 1.

    Args:
        rounds: the paths of each round.
        heights: body heights in meters, which determine the length of steps.
    """

    def __init__(self, rounds: Choreography, heights: Sequence[float]) -> None:
        self._strides = [STRIDE * height for height in heights]
        self._trajectories = lru_cache(maxsize=4)(self._walk)
        self._paths = lru_cache(maxsize=8)(rounds.paths)

    def poses(self, seconds: float) -> list[Pose]:
        """Return all poses at a moment of the scene."""
        number = int(seconds // ROUND)
        return [trajectory.at(seconds - number * ROUND) for trajectory in self._trajectories(number)]

    def _walk(self, number: int) -> list[Trajectory]:
        rounds = [self._paths(number + step) for step in (-1, 0, 1)]
        return [
            _trajectory([paths[walker] for paths in rounds], stride, number * ROUND + 1.3 * walker)
            for walker, stride in enumerate(self._strides)
        ]


def _trajectory(paths: list[RoundPath], stride: float, offset: float) -> Trajectory:
    """Build the trajectory of the middle one of three rounds; it is smoothed across the rounds' ends."""
    spare = int(_AROUND * SAMPLES_PER_SECOND)
    inner = int(ROUND * SAMPLES_PER_SECOND) + 1
    clock = (np.arange(inner + 2 * spare) - spare) / SAMPLES_PER_SECOND
    starts = [-ROUND, 0.0, ROUND]
    # A round's last keyframe is the next one's first.
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
    sway = _SWAY * np.sin(2 * np.pi * (clock[kept] + offset) / _SWAY_SECONDS)
    return Trajectory(
        path[kept], headings[kept] + calm * sway, cumulate_to_whole_strides(paces, stride), speeds
    )


def _bends(paths: list[RoundPath], clock: Floats) -> Floats:
    """Return the offsets of three rounds' paths: ``(T, 2)`` meters."""
    offsets = np.concatenate([path.sampled_offsets[:-1] for path in paths])
    moments = np.concatenate([sample_times()[:-1] + start for start in (-ROUND, 0.0, ROUND)])
    return np.column_stack([np.interp(clock, moments, axis) for axis in offsets.T])
