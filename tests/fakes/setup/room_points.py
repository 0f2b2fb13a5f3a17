"""Places on the floor of the synthetic room, and where its cameras see them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestview.geometry.ground_plane import from_ground, to_ground
from synthetic import Scene

WIDTH, HEIGHT = 320, 180
PLACES = ((4.0, 3.0), (7.0, 3.0), (3.0, 6.0), (8.0, 6.0), (5.5, 7.0), (5.0, 4.5))
"""In meters; both cameras see them."""

Floats = NDArray[np.float64]


def homography(camera: int) -> Floats:
    """Return the true homography of one of the room's two cameras, from its pixels to the floor."""
    matrix = Scene("room", 2, 1, width=WIDTH, height=HEIGHT).homography(camera)
    assert matrix is not None
    return matrix


def image_of(camera: int, *places: tuple[float, float]) -> Floats:
    """Return where a camera sees places, to a tenth of a pixel as the page marks them: (N, 2)."""
    return np.round(from_ground(homography(camera), np.array(places)), 1)


def pairs(camera: int, *places: tuple[float, float]) -> list[dict[str, Any]]:
    """Return marked points as in a file of points; by default all places."""
    chosen = places or PLACES
    return [
        {"image": image, "floor": list(place)}
        for image, place in zip(image_of(camera, *chosen).tolist(), chosen, strict=True)
    ]


def error_of(found: Any, camera: int) -> float:
    """Return how far, at most, in meters, a homography is off the true one where both cameras see."""
    x, y = np.meshgrid(np.linspace(4, 7, 7), np.linspace(3, 7, 9))
    places = np.column_stack([x.ravel(), y.ravel()])
    mapped = to_ground(np.array(found, dtype=np.float64), from_ground(homography(camera), places))
    return float(np.hypot(*(mapped - places).T).max())
