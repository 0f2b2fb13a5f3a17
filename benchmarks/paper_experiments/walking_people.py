"""Simulated walking people: the position of their feet in every frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.paper_experiments.scene import HEIGHT, WIDTH
from tracking.boxes import Floats

_FAR_Y, _NEAR_Y = 130.0, 280.0
"""Rows of the picture between which the feet are."""
_OUT = 60.0
"""Pixels beyond a side at which a person is completely out of the picture."""
_NEAR_GOAL = 12.0


@dataclass(frozen=True, slots=True)
class WalkParameters:
    """How people move.

    Attributes:
        speed: pixels per frame at most.
        turn: share of the change to the target velocity in each frame: how sharply they turn.
        stay: shortest and longest stay in the picture, frames; None: forever.
        away: shortest and longest absence, frames.
        side: distance that they keep from the picture's sides, pixels; the larger, the more often they meet.
    """

    speed: float
    turn: float
    stay: tuple[int, int] | None = None
    away: tuple[int, int] = (60, 200)
    side: float = 30.0


class Walker:
    """A person who walks from goal to goal."""

    def __init__(self, walking: WalkParameters, start: Floats, rng: np.random.Generator) -> None:
        self._walking, self._rng = walking, rng
        self._place, self._velocity = start, np.zeros(2)
        self._goal = self._new_goal()
        self._leaves_in = self._draw(walking.stay)
        self._back_in = 0

    def step(self) -> Floats:
        """Return the feet in the next frame, NaN while absent."""
        if self._back_in:
            self._back_in -= 1
            if not self._back_in:
                self._return()
            return np.full(2, np.nan)
        if self._leaves_in == 0:
            self._goal = np.array([self._nearest_out(), self._place[1]])
        elif np.abs(self._goal - self._place).sum() < _NEAR_GOAL:
            self._goal = self._new_goal()
        way = self._goal - self._place
        wanted = way / max(float(np.hypot(*way)), 1.0) * self._walking.speed * self._rng.uniform(0.5, 1.0)
        self._velocity = self._velocity + self._walking.turn * (wanted - self._velocity)
        self._place = self._place + self._velocity
        self._leaves_in = max(self._leaves_in - 1, 0) if self._walking.stay else -1
        if not -_OUT < self._place[0] < WIDTH + _OUT:
            self._back_in = self._draw(self._walking.away)
        return self._place.copy()

    def _return(self) -> None:
        left = self._rng.random() < 0.5
        self._place = np.array([-_OUT + 1.0 if left else WIDTH + _OUT - 1.0, self._new_goal()[1]])
        self._velocity = np.zeros(2)
        self._goal = self._new_goal()
        self._leaves_in = self._draw(self._walking.stay)

    def _nearest_out(self) -> float:
        return -2.0 * _OUT if self._place[0] < WIDTH / 2 else WIDTH + 2.0 * _OUT

    def _new_goal(self) -> Floats:
        side = self._walking.side
        return np.array([self._rng.uniform(side, WIDTH - side), self._rng.uniform(_FAR_Y, _NEAR_Y)])

    def _draw(self, span: tuple[int, int] | None) -> int:
        return -1 if span is None else int(self._rng.integers(*span))


def walks(people: int, frames: int, walking: WalkParameters, rng: np.random.Generator) -> Floats:
    """Return the feet of each person in each frame, `(people, frames, 2)` pixels; NaN while absent.

    In the first frame all are present, side by side.
    """
    apart = (WIDTH - 2 * walking.side) / people
    starts = [
        np.array([walking.side + (k + 0.5) * apart, rng.uniform(_FAR_Y + 20, _NEAR_Y - 20)])
        for k in range(people)
    ]
    walkers = [Walker(walking, start, rng) for start in starts]
    return np.array([[walker.step() for _ in range(frames)] for walker in walkers])


def people_at(feet: Floats, height: float) -> Floats:
    """Return the boxes of people at these feet, `(..., 4)`; `height`, pixels, is that of the nearest."""
    x, y = feet[..., 0], feet[..., 1]
    tall = height * (0.62 + 0.38 * (y - _FAR_Y) / (_NEAR_Y - _FAR_Y))
    wide = 0.42 * tall
    return np.stack([x - wide / 2, y - tall, x + wide / 2, y], axis=-1)


def inside(boxes: Floats) -> Floats:
    """Clip boxes `(..., 4)` to the picture; NaN where less than a third of the width is left."""
    cut = boxes.copy()
    cut[..., 0::2] = np.clip(boxes[..., 0::2], 0.0, WIDTH)
    cut[..., 1::2] = np.clip(boxes[..., 1::2], 0.0, HEIGHT)
    left = (cut[..., 2] - cut[..., 0]) / np.maximum(boxes[..., 2] - boxes[..., 0], 1e-9)
    cut[~(left > 1.0 / 3.0)] = np.nan
    return cut
