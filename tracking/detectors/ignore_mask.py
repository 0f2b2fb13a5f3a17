"""Ignored polygons of the image: overlays, a street behind a window, a monitor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats
from tracking.detectors.base import Mask
from tracking.homographies import map_points

Polygon: TypeAlias = Sequence[tuple[float, float]]
"""Corners `(x, y)` in pixels of the camera's image, in order; at least three."""
Polygons: TypeAlias = Sequence[Polygon]
"""The ignored areas of an image."""


def visible_mask(height: int, width: int, polygons: Sequence[Polygon], scale: float = 1.0) -> Mask:
    """Return a mask `(height, width)` that is 0 inside the polygons and 255 elsewhere.

    Args:
        height: rows of the mask.
        width: columns of the mask.
        polygons: the ignored areas; corners are multiplied by `scale` first.
        scale: pixels of the mask per pixel of the camera's image.

    Raises:
        ValueError: a polygon has fewer than three corners.
    """
    mask = np.full((height, width), 255, dtype=np.uint8)
    for polygon in polygons:
        corners = np.asarray(polygon, dtype=np.float64).reshape(-1, 2)
        if len(corners) < 3:  # noqa: PLR2004 — a polygon is at least a triangle
            raise ValueError(f"an ignored polygon needs at least 3 corners, not {len(corners)}")
        cv2.fillPoly(mask, [np.rint(corners * scale).astype(np.int32)], (0,))
    return mask


def move_polygons(polygons: Polygons, matrix: Floats) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Return polygons under a homography (3, 3); those that it maps beyond the horizon are left out."""
    moved = []
    for polygon in polygons:
        corners = map_points(matrix, np.asarray(polygon, dtype=np.float64))
        if np.isfinite(corners).all():
            moved.append(tuple((float(x), float(y)) for x, y in corners))
    return tuple(moved)


class IgnoreFilter:
    """Filters out boxes that lie mostly inside ignored polygons."""

    def __init__(self, polygons: Polygons) -> None:
        self._polygons = polygons
        self._sums: Floats | None = None

    def keep(self, shape: tuple[int, ...], boxes: Floats) -> npt.NDArray[np.bool_]:
        """Return which boxes `(N, 4)` in an image of `shape` are visible enough, `(N,)`."""
        if not self._polygons:
            return np.ones(len(boxes), dtype=np.bool_)
        if self._sums is None or self._sums.shape != (shape[0] + 1, shape[1] + 1):
            mask = visible_mask(shape[0], shape[1], self._polygons) > 0
            self._sums = np.pad(mask.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0))).astype(np.float64)
        limits = np.array([shape[1], shape[0]] * 2, dtype=np.float64)
        left, top, right, bottom = np.rint(np.clip(boxes, 0.0, limits)).astype(np.int64).T
        visible = self._sums[bottom, right] - self._sums[top, right]
        visible += self._sums[top, left] - self._sums[bottom, left]
        return np.asarray(visible >= _MIN_VISIBLE * np.maximum((right - left) * (bottom - top), 1))


# Least share of a box that is not ignored.
_MIN_VISIBLE = 0.45
