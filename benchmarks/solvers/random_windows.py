"""Windows to time solvers on: random observations, as in the paper's Fig. 21, and people who walk or meet."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.model.network import CostSettings, Network, Template, build_network
from tracking.types import Detections

BINS = 64
PERSON = np.array([40.0, 100.0])
CIF, VGA, HD = np.array([352.0, 288.0]), np.array([640.0, 480.0]), np.array([1920.0, 1080.0])
SEEN, COVERED = 0.9, 0.4
"""Share of people who are detected, and the distance in sizes of a person within which one covers another."""


@dataclass(frozen=True, slots=True)
class WindowSize:
    """The size of a window: `objects`, `places` in each frame, `frames`."""

    objects: int
    places: int
    frames: int = 20


def random_window(size: WindowSize, settings: CostSettings, seed: int) -> Network:
    """Build a window of random boxes and histograms (paper IV.A.5): no motion, binding conflicts."""
    rng = np.random.default_rng(seed)

    def seen(count: int) -> Detections:
        corners = rng.uniform(0.0, CIF, (count, 2))
        boxes = np.hstack([corners, corners + 0.7 * PERSON])
        return Detections(boxes, np.ones(count), rng.dirichlet(np.ones(BINS), count))

    first = seen(size.objects)
    templates = [Template(n, first.histograms[n], first.boxes[n]) for n in range(size.objects)]
    return build_network(templates, [seen(size.places) for _ in range(size.frames)], settings)


class Walkers:
    """Walking people in a picture `(2,)` pixels large, among false positives, some of which resemble one."""

    def __init__(self, size: WindowSize, seed: int, picture: Floats = VGA) -> None:
        self._size, self._picture = size, picture
        self._rng = np.random.default_rng(seed)
        self.looks = self._rng.dirichlet(np.full(BINS, 0.5), size.objects)
        self.corners = self._rng.uniform(0.0, picture, (size.objects, 2))
        self._speed = self._rng.normal(0.0, 3.0, (size.objects, 2))

    def templates(self) -> list[Template]:
        """Return the templates of all people at their current places."""
        return [
            Template(n, self.looks[n], np.concatenate([self.corners[n], self.corners[n] + PERSON]))
            for n in range(self._size.objects)
        ]

    def meet(self, frames: int) -> None:
        """Let people walk in pairs towards each other, at the same place after so many frames."""
        for first in range(0, self._size.objects - 1, 2):
            self._speed[first + 1] = -self._speed[first]
            self.corners[first + 1] = self.corners[first] + 2.0 * frames * self._speed[first]

    def _visible(self) -> np.ndarray:
        """Return who is detected: few are missed, and those whom somebody else covers are."""
        apart = np.abs(self.corners[:, None] - self.corners) / PERSON
        covered = np.tril((apart < COVERED).all(axis=2), -1).any(axis=1)
        seen = (self._rng.uniform(size=self._size.objects) < SEEN) & ~covered
        return np.flatnonzero(seen)[: self._size.places]

    def step(self) -> Detections:
        """Move by a frame, turning back at the edges; return the observations."""
        rng, size = self._rng, self._size
        self._speed += rng.normal(0.0, 0.5, self._speed.shape)
        self._speed = np.clip(self._speed, -6.0, 6.0)
        out = ((self.corners < 0) & (self._speed < 0)) | ((self.corners > self._picture) & (self._speed > 0))
        self._speed[out] *= -1.0
        self.corners += self._speed
        visible = self._visible()
        stray = size.places - len(visible)
        corners = np.vstack(
            [
                self.corners[visible] + rng.normal(0.0, 2.0, (len(visible), 2)),
                rng.uniform(0.0, self._picture, (stray, 2)),
            ]
        )
        alike = self.looks[rng.integers(size.objects, size=stray)] * 50.0
        alike[rng.uniform(size=stray) < 0.5] = 0.5
        weights = np.vstack([self.looks[visible] * 300.0, alike]) + 1e-3
        looks = rng.standard_gamma(weights) + 1e-12
        order = rng.permutation(size.places)
        boxes = np.hstack([corners, corners + PERSON])
        return Detections(
            boxes[order], np.ones(size.places), (looks / looks.sum(axis=1, keepdims=True))[order]
        )


def walking_window(size: WindowSize, settings: CostSettings, seed: int) -> Network:
    """Build a window of walking people."""
    people = Walkers(size, seed)
    templates = people.templates()
    return build_network(templates, [people.step() for _ in range(size.frames)], settings)


def meeting_window(size: WindowSize, settings: CostSettings, seed: int) -> Network:
    """Build a window in whose middle people meet in pairs, and walk on."""
    people = Walkers(size, seed)
    people.meet(size.frames // 2)
    templates = people.templates()
    return build_network(templates, [people.step() for _ in range(size.frames)], settings)


def moving_windows(
    size: WindowSize, steps: int, seed: int
) -> Iterator[tuple[list[Template], list[Detections]]]:
    """Yield the windows of a tracker with a stride of one frame."""
    people = Walkers(size, seed)
    past = [people.templates()]
    frames: list[Detections] = []
    for _ in range(size.frames + steps - 1):
        frames.append(people.step())
        past.append(people.templates())
        if len(frames) == size.frames:
            yield past.pop(0), list(frames)
            frames.pop(0)
