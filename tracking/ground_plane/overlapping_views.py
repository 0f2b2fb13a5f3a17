"""Which cameras see the same part of the ground plane.

One camera alone sees people better in its picture, where it knows how its detector errs: joining it with
cameras that look elsewhere adds nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.ground_plane.camera import GroundCamera

_MIN_SHARE = 0.1
"""Share of the floor in a camera's picture that another must see."""
_GRID = 24
"""Foot points per row and column of a picture."""
_MAX_DISTANCE = 8.0
"""How many times smaller than at the lower edge people may be in a picture."""


def overlapping_cameras(cameras: Mapping[str, GroundCamera]) -> frozenset[str]:
    """Return the cameras that see, together with another one, a part of what either shows of the floor."""
    found: set[str] = set()
    for (one, first), (other, second) in combinations(cameras.items(), 2):
        if max(_shared(first, second), _shared(second, first)) >= _MIN_SHARE:
            found |= {one, other}
    return frozenset(found)


def _shared(camera: GroundCamera, other: GroundCamera) -> float:
    """Return the share of the floor in a camera's picture on which the other sees people, too."""
    columns, rows = np.meshgrid(*((np.arange(_GRID) + 0.5) / _GRID for _ in range(2)))
    points = np.stack([columns.ravel() * camera.width, rows.ravel() * camera.height], axis=1)
    points = points[_shows_people(camera, points)]
    if not len(points):
        return 0.0
    return float(np.mean(_shows_people(other, other.to_image(camera.to_ground(points)))))


def _shows_people(camera: GroundCamera, points: Floats) -> NDArray[np.bool_]:
    """Return at which image points (K, 2) people can stand: on the floor, in the picture, not too far."""
    inside = camera.contains(points)
    shown = np.zeros(len(points), dtype=np.bool_)
    shown[inside] = _is_floor(camera, points[inside])
    near = float(_sideways(camera, np.array([[camera.width / 2.0, camera.height]]))[0])
    shown[shown] = _sideways(camera, points[shown]) < _MAX_DISTANCE * near
    return shown


def _is_floor(camera: GroundCamera, points: Floats) -> NDArray[np.bool_]:
    """Return which image points (K, 2) are below the horizon: those beyond are behind the camera."""
    return np.asarray(np.isfinite(camera.to_image(camera.to_ground(points))).all(axis=1))


def _sideways(camera: GroundCamera, points: Floats) -> Floats:
    """Return how long a pixel to the right is on the ground at image points (K, 2), (K,)."""
    return np.asarray(np.hypot(*camera.jacobians(points)[:, :, 0].T))
