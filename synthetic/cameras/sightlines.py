"""Staging: how ways look from where the cameras hang."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.room.room import Point

_STEP = 0.7  # metres across the picture after which a walker shows what was behind them
_BETTER = 1.3  # times as large as the best view so far must a view be to become the best
_ABOVE = 2.1  # metres from a body's middle up to a camera
_FRAME = 0.4  # seconds from one look at the cameras to the next
_SOONEST, _LATEST = 7.0, 13.0  # seconds for which one camera should be the best


@dataclass(frozen=True, slots=True)
class Shot:
    """Which camera shows a walker largest, and since when."""

    eye: int
    held: float  # seconds
    fault: float = 0.0  # how far shots ended too early or too late on the way here


def shoot(where: Point, eyes: tuple[Point, ...]) -> Shot:
    """Begin to look at a walker."""
    sizes = _sizes(where, eyes)
    return Shot(sizes.index(max(sizes)), 0.0)


def follow(shot: Shot, start: Point, end: Point, seconds: float, eyes: tuple[Point, ...]) -> Shot:
    """Follow a walker from a point to another."""
    eye, held, fault = shot.eye, shot.held, 0.0
    steps = max(math.ceil(seconds / _FRAME), 1)
    for step in range(1, steps + 1):
        held += seconds / steps
        share = step / steps
        sizes = _sizes((start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share), eyes)
        best = max(sizes)
        if best > _BETTER * sizes[eye]:
            fault += max(_SOONEST - held, held - _LATEST, 0.0)
            eye, held = sizes.index(best), 0.0
    return Shot(eye, held, fault + max(held - _LATEST, 0.0))


def _sizes(where: Point, eyes: tuple[Point, ...]) -> list[float]:
    x, y = where
    return [1 / ((x - eye[0]) ** 2 + (y - eye[1]) ** 2 + _ABOVE**2) for eye in eyes]


def lurking(mine: Floats, eyes: Floats) -> float:
    """Rate how little a way ``(T, 2)`` moves across the pictures of the `eyes` ``(C, 2)``; 0 is enough."""
    rate = 0.0
    for eye in eyes:
        sight = mine[0] - eye
        step = mine[-1] - mine[0]
        across = abs(float(sight[0] * step[1] - sight[1] * step[0])) / max(float(np.hypot(*sight)), 1e-6)
        rate += max(_STEP - across, 0.0) ** 2
    return rate
