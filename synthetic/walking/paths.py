"""Ways of people who never leave: planned in rounds, bent where they would walk into each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.walking.collision_avoidance import give_way

ROUND = 10.0  # seconds
BEFORE = 10_000  # rounds before the scene begins have numbers too, and a seed takes none below zero
_RATE = 10  # samples a second at which ways are compared


@dataclass(frozen=True, slots=True)
class Way:
    """Where one goes in a round: moments (K,), places (K, 2) and the direction faced after each (K,)."""

    times: Floats  # seconds into the round; the first is 0 and the last is `ROUND`
    places: Floats  # metres
    faces: Floats  # radians
    aside: Floats  # (T, 2) metres by which the way is bent, at the moments `compared()`

    def at(self, moments: Floats) -> Floats:
        """Give the places ``(T, 2)`` at moments ``(T,)``."""
        straight = [np.interp(moments, self.times, axis) for axis in self.places.T]
        bends = [np.interp(moments, compared(), axis) for axis in self.aside.T]
        places: Floats = np.column_stack(straight) + np.column_stack(bends)
        return places


class Choreography(Protocol):
    """Everybody's ways, round by round: a round begins where the one before has ended."""

    def ways(self, number: int) -> list[Way]:
        """Give the ways of a round; a pure function of its number, which may be negative."""
        ...


def compared() -> Floats:
    """Give the moments of a round ``(T,)`` at which ways are compared, seconds."""
    return np.arange(int(ROUND * _RATE) + 1) / _RATE


def straight_way(times: Floats, places: Floats, faces: Floats) -> Way:
    """Give a way that is not bent yet."""
    return Way(times, places, faces, np.zeros((len(compared()), 2)))


def towards(start: Floats, end: Floats) -> float:
    """Give the direction from a place ``(2,)`` to another, radians."""
    return float(np.arctan2(end[1] - start[1], end[0] - start[0]))


def bend(ways: Sequence[Way], keep: Floats) -> tuple[Way, ...]:
    """Let people give way to each other until any two keep ``(P, P)`` metres apart."""
    straight = np.array([way.at(compared()) for way in ways])
    bends = give_way(straight, keep, _RATE) - straight
    return tuple(replace(way, aside=aside) for way, aside in zip(ways, bends, strict=True))


def crowding(ways: Sequence[Way], keep: Floats) -> float:
    """Rate how much people are in each other's way ``(P, P)`` metres; 0 is not at all."""
    places = np.array([way.at(compared()) for way in ways])
    gaps = np.linalg.norm(places[:, None] - places[None], axis=3)
    short = np.maximum(keep[..., None] - gaps, 0)
    short[np.arange(len(ways)), np.arange(len(ways))] = 0
    return float((short**2).sum())
