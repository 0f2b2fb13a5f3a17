"""A simulated square with cameras all around it, each of which sees everybody whom nobody hides."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from synthetic.cameras.pinhole import PinholeCamera, Viewpoint
from tracking import Detections
from tracking.boxes import Floats, areas, intersections
from tracking.ground_plane import GroundCamera

FPS = 10.0
_WIDTH, _HEIGHT, _FIELD_OF_VIEW = 1280, 720, 90.0
_SIDE = 24.0
"""Meters."""
_EYE, _DISTANCE = 5.0, 16.0
"""Height of the cameras, and their distance from the middle, meters."""
_TALL, _ASPECT, _PACE = 1.75, 0.36, 1.2
"""Meters, width by height, meters per second."""
_MISSED, _NOISE, _FALSE = 0.05, 0.006, 0.2
"""Share of people missed, errors of edges by the height of the box, false detections per picture."""
_HIDDEN = 0.6
"""Share of a box that somebody nearer hides from which it is not detected."""
_BINS, _CONCENTRATION = 48, 200.0


@dataclass(frozen=True)
class SimulatedSquare:
    """A square with so many cameras and people, who walk from one random place to the next."""

    cameras: int
    people: int

    @cached_property
    def views(self) -> dict[str, GroundCamera]:
        """The cameras by name, over the floor in meters."""
        return {
            name: GroundCamera(camera.homography(), float(_WIDTH), float(_HEIGHT))
            for name, camera in self._cameras.items()
        }

    @cached_property
    def _cameras(self) -> dict[str, PinholeCamera]:
        middle, found = _SIDE / 2, {}
        for index in range(self.cameras):
            angle = 2 * math.pi * index / self.cameras
            position = (middle + _DISTANCE * math.cos(angle), middle + _DISTANCE * math.sin(angle), _EYE)
            view = Viewpoint(position, (middle, middle, 0.0), _FIELD_OF_VIEW)
            found[f"c{index:02d}"] = PinholeCamera.at(view, _WIDTH, _HEIGHT)
        return found

    def frames(self, count: int) -> Iterator[Mapping[str, Detections]]:
        """Yield the detections of each of so many frames by camera."""
        random = np.random.default_rng(1)
        looks = random.dirichlet(np.full(_BINS, 0.3), self.people)
        places, targets = random.uniform(0.0, _SIDE, (2, self.people, 2))
        for _ in range(count):
            ahead = targets - places
            distances = np.linalg.norm(ahead, axis=1, keepdims=True)
            places = places + np.minimum(_PACE / FPS / np.maximum(distances, 1e-9), 1.0) * ahead
            arrived = distances[:, 0] < 2.0 * _PACE / FPS
            targets[arrived] = random.uniform(0.0, _SIDE, (int(arrived.sum()), 2))
            yield {name: _detect(camera, places, looks, random) for name, camera in self._cameras.items()}


def _detect(camera: PinholeCamera, places: Floats, looks: Floats, random: np.random.Generator) -> Detections:
    """Return the detections of a picture."""
    boxes = _boxes(camera, places)
    nearer = boxes[None, :, 3] > boxes[:, None, 3]
    shares = intersections(boxes[:, None], boxes[None]) / areas(boxes)[:, None]
    inside = (boxes[:, 0] > 0.0) & (boxes[:, 2] < _WIDTH) & (boxes[:, 3] < _HEIGHT)
    seen = inside & ((shares * nearer).max(axis=1, initial=0.0) < _HIDDEN)
    seen &= random.random(len(boxes)) >= _MISSED
    tall = (boxes[seen, 3] - boxes[seen, 1])[:, None]
    found = boxes[seen] + _NOISE * tall * random.standard_normal((int(seen.sum()), 4))
    false = _boxes(camera, random.uniform(0.0, _SIDE, (random.poisson(_FALSE), 2)))
    histograms = [random.dirichlet(_CONCENTRATION * look + 1e-3) for look in looks[seen]]
    histograms += [random.dirichlet(np.ones(_BINS)) for _ in false]
    return Detections(
        np.concatenate([found, false]),
        np.full(len(found) + len(false), 0.9),
        np.array(histograms).reshape(-1, _BINS),
    )


def _boxes(camera: PinholeCamera, places: Floats) -> Floats:
    """Return the boxes of people at places (N, 2), (N, 4)."""
    feet, heads = (
        camera.project(np.column_stack([places, np.full(len(places), height)]))[0] for height in (0.0, _TALL)
    )
    x, bottom, top = feet[:, 0], feet[:, 1], heads[:, 1]
    half = _ASPECT * (bottom - top) / 2.0
    return np.stack([x - half, top, x + half, bottom], axis=1)
