"""Paths of people who never leave: planned in rounds, bent apart where they would collide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.walking.collision_avoidance import push_paths_apart

ROUND = 10.0  # seconds
BEFORE = 10_000  # added to numbers of rounds in seeds, which cannot be negative
_RATE = 10  # samples a second at which ways are compared


@dataclass(frozen=True, slots=True)
class RoundPath:
    """One person's path in a round: times (K,), places (K, 2) and the direction faced after each (K,)."""

    times: Floats  # seconds into the round; the first is 0 and the last is `ROUND`
    places: Floats  # meters
    facing: Floats  # radians
    offsets: Floats  # (T, 2) meters by which the way is bent, at the moments `sample_times()`

    def at(self, moments: Floats) -> Floats:
        """Return the places ``(T, 2)`` at moments ``(T,)``."""
        straight = [np.interp(moments, self.times, axis) for axis in self.places.T]
        bends = [np.interp(moments, sample_times(), axis) for axis in self.offsets.T]
        places: Floats = np.column_stack(straight) + np.column_stack(bends)
        return places


class Choreography(Protocol):
    """Everybody's paths, round by round: a round begins where the one before has ended."""

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
    """Bend paths until any two people keep ``(P, P)`` meters apart."""
    straight = np.array([path.at(sample_times()) for path in paths])
    bends = push_paths_apart(straight, keep, _RATE) - straight
    return tuple(replace(path, offsets=offsets) for path, offsets in zip(paths, bends, strict=True))


def crowding_cost(paths: Sequence[RoundPath], keep: Floats) -> float:
    """Compute the cost of pairs nearer than ``(P, P)`` meters; 0 is none."""
    places = np.array([path.at(sample_times()) for path in paths])
    gaps = np.linalg.norm(places[:, None] - places[None], axis=3)
    short = np.maximum(keep[..., None] - gaps, 0)
    short[np.arange(len(paths)), np.arange(len(paths))] = 0
    return float((short**2).sum())
