"""People who walk on a floor of 10 by 10 meters, as the boxes of three cameras around it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tracking import Detections
from tracking.boxes import Floats
from tracking.ground_plane import GroundCamera, GroundFrame

WIDTH, HEIGHT = 640.0, 480.0
FPS = 5.0
_FOCAL = 500.0
_PERSON_M, _ASPECT = 1.75, 0.36
_POSITIONS = {"c0": (-4.0, -4.0, 3.0), "c1": (14.0, -3.0, 3.5), "c2": (5.0, 15.0, 4.0)}
"""Of the cameras, which look at the middle of the floor."""


@dataclass(frozen=True, slots=True, eq=False)
class FloorView:
    """One camera: its calibration, and the projection of points in space."""

    projection: Floats
    camera: GroundCamera

    def box(self, place: Floats) -> Floats:
        """Return the box (4,) of a person at a place (2,)."""
        points = np.array([[*place, 0.0, 1.0], [*place, _PERSON_M, 1.0]]) @ self.projection.T
        (x, bottom), (_, top) = points[:, :2] / points[:, 2:]
        half = _ASPECT * (bottom - top) / 2.0
        return np.array([x - half, top, x + half, bottom])


def floor_views() -> dict[str, FloorView]:
    """Return the three cameras."""
    return {name: _look_at(np.array(position)) for name, position in _POSITIONS.items()}


def _look_at(position: Floats) -> FloorView:
    forward = np.array([5.0, 5.0, 0.8]) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    intrinsic = np.array([[_FOCAL, 0.0, WIDTH / 2.0], [0.0, _FOCAL, HEIGHT / 2.0], [0.0, 0.0, 1.0]])
    projection = intrinsic @ np.concatenate([rotation, -rotation @ position[:, None]], axis=1)
    homography = np.linalg.inv(projection[:, [0, 1, 3]])
    return FloorView(projection, GroundCamera(homography / homography[2, 2], WIDTH, HEIGHT))


@dataclass(frozen=True, slots=True, eq=False)
class FloorNoise:
    """What is wrong with the detections: shares, box heights, and false boxes per picture."""

    missed: float = 0.0
    deviation: float = 0.0
    false: float = 0.0


def detect_walkers(
    walks: Floats, views: Mapping[str, FloorView], noise: FloorNoise, seed: int = 0
) -> list[dict[str, Detections]]:
    """Return the detections of every frame by camera.

    `walks` (F, N, 2) are places in meters, NaN where a person is not there.
    """
    random = np.random.default_rng(seed)
    return [{name: _detect(places, view, noise, random) for name, view in views.items()} for places in walks]


def _detect(places: Floats, view: FloorView, noise: FloorNoise, random: np.random.Generator) -> Detections:
    boxes = []
    for place in places:
        if np.isnan(place[0]) or random.random() < noise.missed:
            continue
        box = view.box(place)
        boxes.append(box + noise.deviation * (box[3] - box[1]) * random.standard_normal(4))
    for _ in range(random.poisson(noise.false)):
        left, top = random.uniform(0.0, 600.0), random.uniform(100.0, 300.0)
        boxes.append(np.array([left, top, left + 30.0, top + 90.0]))
    kept = np.array(boxes).reshape(-1, 4)
    return Detections(kept, np.full(len(kept), 0.9), np.zeros((len(kept), 0)))


def true_ids(frames: list[GroundFrame], walks: Floats, radius: float = 0.6) -> list[set[int]]:
    """Return the ids of the tracks nearest to each person over all frames; within `radius` meters."""
    ids: list[set[int]] = [set() for _ in range(walks.shape[1])]
    for frame in frames:
        for track in frame.tracks:
            distances = np.linalg.norm(walks[frame.frame] - track.place, axis=1)
            if np.nanmin(distances) < radius:
                ids[int(np.nanargmin(distances))].add(track.id)
    return ids
