"""Parts of the picture to ignore: overlays, a street behind a window, a monitor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import cv2
import numpy as np

from tracking.detectors.base import Mask

Polygon: TypeAlias = Sequence[tuple[float, float]]
"""Corners `(x, y)` in pixels of the camera's picture, in order; at least three."""


def visible_mask(height: int, width: int, polygons: Sequence[Polygon], scale: float = 1.0) -> Mask:
    """Give a mask `(height, width)` that is 0 inside the polygons and 255 elsewhere.

    Args:
        height: rows of the mask.
        width: columns of the mask.
        polygons: what to ignore; corners are multiplied by `scale` first.
        scale: pixels of the mask per pixel of the camera's picture.

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
