"""A baseline: places found frame by frame, linked by the Hungarian method with constant velocity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from tracking import Detections
from tracking.boxes import Floats
from tracking.ground_plane import GroundCamera, GroundSettings
from tracking.ground_plane.camera import BoxSizes
from tracking.ground_plane.places.hypotheses import Places, find_places
from tracking.ground_plane.places.measurements import measure
from tracking.motchallenge import MotRow

_GATE_M = 1.5
"""Meters by which somebody may be away from where they were expected."""
_GATE_MPS = 3.0
"""Likewise per second."""
_FORGET_S = 1.0
_VELOCITY_WEIGHT = 0.5
_IMPOSSIBLE = 1e6


@dataclass(slots=True)
class _Walker:
    id: int
    place: Floats
    velocity: Floats
    frame: int


def track_frame_by_frame(
    cameras: Mapping[str, GroundCamera],
    frames: Sequence[Mapping[str, Detections]],
    fps: float,
) -> dict[str, list[MotRow]]:
    """Return each camera's boxes with ids; the cameras' homographies are to meters."""
    settings = GroundSettings()
    names, views = list(cameras), list(cameras.values())
    sizes = [BoxSizes() for _ in cameras]
    rows: dict[str, list[MotRow]] = {name: [] for name in cameras}
    walkers: list[_Walker] = []
    arrived = 0
    for frame, detections in enumerate(frames):
        found = [detections.get(name, Detections.empty(0)) for name in cameras]
        for size, part in zip(sizes, found, strict=True):
            size.update(part.boxes)
        measured = measure(views, found, np.ones(len(found)), settings)
        places = find_places(measured, [], views, sizes, settings, 1.0 / fps)
        chosen = _cheapest(places)
        links = _link(walkers, places.means[chosen], frame, fps)
        for k, place in enumerate(chosen):
            mean = places.means[place]
            if k in links:
                walker = walkers[links[k]]
                moved = (mean - walker.place) / (frame - walker.frame)
                walker.velocity = walker.velocity + _VELOCITY_WEIGHT * (moved - walker.velocity)
                walker.place, walker.frame = mean, frame
            else:
                arrived += 1
                walker = _Walker(arrived, mean, np.zeros(2), frame)
                walkers.append(walker)
            for index in places.groups[place]:
                name = names[int(places.measurements.camera[index])]
                rows[name].append(MotRow.of_box(frame + 1, walker.id, places.measurements.boxes[index]))
        walkers = [walker for walker in walkers if (frame - walker.frame) / fps < _FORGET_S]
    return rows


def _cheapest(places: Places) -> list[int]:
    """Return places that share no detection, the cheapest first."""
    free = np.ones(len(places), dtype=np.bool_)
    chosen = []
    for k in np.argsort(places.costs):
        if free[k] and places.costs[k] < 0.0:
            chosen.append(int(k))
            free &= ~places.conflicts[k]
    return chosen


def _link(walkers: Sequence[_Walker], means: Floats, frame: int, fps: float) -> dict[int, int]:
    """Return the walker of each place that has one."""
    if not walkers or not len(means):
        return {}
    expected = np.array([walker.place + walker.velocity * (frame - walker.frame) for walker in walkers])
    distances = np.linalg.norm(expected[:, None] - means[None], axis=2)
    gates = np.array([_GATE_MPS * (frame - walker.frame) / fps for walker in walkers])
    distances[distances > np.minimum(gates, _GATE_M)[:, None]] = _IMPOSSIBLE
    return {
        int(place): int(walker)
        for walker, place in zip(*linear_sum_assignment(distances), strict=True)
        if distances[walker, place] < _IMPOSSIBLE
    }
