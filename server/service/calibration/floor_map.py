"""The coverage of the floor: each camera's outline on the floor, and the homography to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from server.media.letterbox import Letterbox

Floats = NDArray[np.float64]

FARTHEST_RATIO = 3.0
"""A camera covers the floor up to this multiple of the distance of the nearest floor point in its image."""


@dataclass(frozen=True, slots=True, eq=False)
class FloorCoverage:
    """One camera's coverage of the floor.

    Attributes:
        site_homography: (3, 3) from pixels of the site's image to the ground; its third coordinate is
            positive for points on the floor only, not above the horizon.
        outline: (V, 2) corners of what the camera covers, in ground units; V is 0 if it sees no floor.
    """

    site_homography: Floats
    outline: Floats


def floor_coverage(homography: Floats, size: tuple[int, int], site: tuple[int, int]) -> FloorCoverage:
    """Return a camera's coverage of the floor.

    Args:
        homography: (3, 3) from pixels of the camera's image to the ground.
        size: width and height of that image.
        site: width and height of the site's image.
    """
    letterbox = Letterbox(size, site)
    left, top = letterbox.camera_to_site(np.zeros(2)).tolist()
    to_camera = np.array([[1.0, 0.0, -left], [0.0, 1.0, -top], [0.0, 0.0, letterbox.scale]]) / letterbox.scale
    width, height = (float(side) for side in size)
    # The floor is below the horizon; if there is one, lower in the image is nearer.
    corners = np.array([[0.0, height], [width, height], [width, 0.0], [0.0, 0.0]])
    down = homography[2, 1] if homography[2, 1] != 0 else homography[2, 2]
    matrix = homography * np.sign(down)
    near = float((matrix[2, :2] * corners).sum(axis=1).max() + matrix[2, 2])
    outline = (
        np.empty((0, 2)) if near <= 0 else _mapped(matrix, _clip(corners, matrix[2], near / FARTHEST_RATIO))
    )
    return FloorCoverage(np.asarray(matrix @ to_camera), outline)


def _clip(corners: Floats, row: Floats, minimum: float) -> Floats:
    """Clip a polygon where the third coordinate is below `minimum` (Sutherland, Hodgman)."""
    depth = corners @ row[:2] + row[2] - minimum
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
    mapped = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(mapped[:, :2] / mapped[:, 2:])
