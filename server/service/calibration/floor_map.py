"""The coverage of the floor: each camera's outline on the floor, and the homography to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from server.media.letterbox import Letterbox

Floats = NDArray[np.float64]

FARTHEST_RATIO = 3.0
"""A camera covers the floor up to so many times the distance of the nearest floor point in its picture."""


@dataclass(frozen=True, slots=True, eq=False)
class FloorCoverage:
    """One camera's coverage of the floor.

    Attributes:
        homography: (3, 3) from pixels of the site's picture to the ground; its third coordinate is above 0
            for places on the floor, and not for what is above the horizon.
        outline: (V, 2) corners of what the camera covers, in ground units; V is 0 if it sees no floor.
    """

    homography: Floats
    outline: Floats


def floor_coverage(own: Floats, size: tuple[int, int], site: tuple[int, int]) -> FloorCoverage:
    """Return a camera's coverage of the floor.

    Args:
        own: (3, 3) homography from the camera's own picture, pixels -> ground.
        size: width and height of that picture.
        site: width and height of the site's.
    """
    letterbox = Letterbox(size, site)
    left, top = letterbox.to_site(np.zeros(2)).tolist()
    to_camera = np.array([[1.0, 0.0, -left], [0.0, 1.0, -top], [0.0, 0.0, letterbox.scale]]) / letterbox.scale
    width, height = (float(side) for side in size)
    # The floor lies below the horizon: where there is one, lower in the picture is nearer.
    corners = np.array([[0.0, height], [width, height], [width, 0.0], [0.0, 0.0]])
    down = own[2, 1] if own[2, 1] != 0 else own[2, 2]
    matrix = own * np.sign(down)
    near = float((matrix[2, :2] * corners).sum(axis=1).max() + matrix[2, 2])
    outline = (
        np.empty((0, 2)) if near <= 0 else _mapped(matrix, _clip(corners, matrix[2], near / FARTHEST_RATIO))
    )
    return FloorCoverage(np.asarray(matrix @ to_camera), outline)


def _clip(corners: Floats, row: Floats, least: float) -> Floats:
    """Clip a polygon where the third coordinate is below `least` (Sutherland, Hodgman)."""
    depth = corners @ row[:2] + row[2] - least
    clipped: list[Floats] = []
    for at, corner in enumerate(corners):
        before = at - 1
        if (depth[before] < 0) != (depth[at] < 0):
            share = depth[before] / (depth[before] - depth[at])
            clipped.append(corners[before] + share * (corner - corners[before]))
        if depth[at] >= 0:
            clipped.append(corner)
    return np.array(clipped).reshape(-1, 2)


def _mapped(matrix: Floats, points: Floats) -> Floats:
    places = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(places[:, :2] / places[:, 2:])
