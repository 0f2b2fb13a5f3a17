"""Framing terms of view quality: how large, how central and how complete a person is in the picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_EDGE_MARGIN = 0.03
"""Distance from an edge, in box heights, from which a box counts as clear of it."""
_EDGE_PENALTY = 0.05
"""Penalty of a box at the upper or lower edge: how much lies beyond is unknown."""
_MINIMUM_MARGIN = 1e-6
"""Pixels; avoids a division by zero for boxes without height."""
_UPRIGHT_ASPECT_RATIO = 0.37
"""Width over height of the box of an upright person: a slimmer one at a side edge is truncated."""


def areas_inside_picture(boxes: Floats, picture_boxes: Floats) -> Floats:
    """Return the area of the part of each box inside its picture: two (..., 4), broadcast to (...)."""
    width = np.minimum(boxes[..., 2], picture_boxes[..., 2]) - np.maximum(
        boxes[..., 0], picture_boxes[..., 0]
    )
    height = np.minimum(boxes[..., 3], picture_boxes[..., 3]) - np.maximum(
        boxes[..., 1], picture_boxes[..., 1]
    )
    return np.asarray(np.maximum(width, 0.0) * np.maximum(height, 0.0))


def areas(boxes: Floats) -> Floats:
    """Return the area of each box, (..., 4) -> (...); 0 where its sides are in reverse order."""
    width, height = boxes[..., 2] - boxes[..., 0], boxes[..., 3] - boxes[..., 1]
    return np.asarray(np.maximum(width, 0.0) * np.maximum(height, 0.0))


def area_ratios(parts: Floats, wholes: Floats) -> Floats:
    """Divide areas; 0 where the whole has no area."""
    return np.asarray(np.divide(parts, wholes, out=np.zeros(parts.shape), where=wholes > 0))


def size_quality(boxes: Floats, width: float, height: float) -> NDArray[np.float64]:
    """Return the linear size of the part of each box inside the picture: ``sqrt(box area / picture area)``.

    The paper's view quality is the size of the bounding box (section III). The root makes it proportional to
    nearness instead of its square, so that one very near view does not make all others look equally bad.

    Args:
        boxes: (..., 4) left, top, right, bottom in pixels; NaN where the object is hidden.
        width: of the picture, pixels.
        height: of the picture, pixels.

    Returns:
        (...) values in [0, 1]; 0 where hidden, outside the picture or empty.

    Raises:
        ValueError: a picture without area, or boxes whose last axis is not 4 long.
    """
    if not (width > 0 and height > 0):
        raise ValueError(f"a picture of {width} x {height} pixels has no area")
    if boxes.ndim < 1 or boxes.shape[-1] != 4:  # noqa: PLR2004 — left, top, right, bottom
        raise ValueError(f"boxes have shape {boxes.shape}, not (..., 4)")
    area = areas_inside_picture(boxes, np.array([0.0, 0.0, width, height]))
    return np.asarray(np.sqrt(np.nan_to_num(area) / (width * height)))


def centering_score(boxes: Floats, picture_boxes: Floats) -> Floats:
    """Return the centering score: 1 in the middle of the picture, 0 in its corners.

    ``1 - distance of the middles / half the diagonal``

    Args:
        boxes: (..., 4) pixels, without hidden ones.
        picture_boxes: (..., 4) each camera's own picture, pixels; broadcast to `boxes`.

    Returns:
        (...) values in [0, 1].
    """
    offset = (boxes[..., :2] + boxes[..., 2:] - picture_boxes[..., :2] - picture_boxes[..., 2:]) / 2.0
    diagonal = picture_boxes[..., 2:] - picture_boxes[..., :2]
    half = np.hypot(diagonal[..., 0], diagonal[..., 1]) / 2.0
    return np.asarray(np.clip(1.0 - np.hypot(offset[..., 0], offset[..., 1]) / half, 0.0, 1.0))


def untruncated_share(boxes: Floats, picture_boxes: Floats) -> Floats:
    """Estimate the share of the person inside the picture from the box.

    ``area(box in picture) / area(box)``, times ``1 - 0.05 n`` for the nearer of the upper and lower edge,
    times ``1 - n (1 - min(width / (0.37 height), 1))`` for the nearer side edge, with `n` how near it is:
    ``1 - min(gap / (0.03 height), 1)``. Detectors keep their boxes inside the picture. One that ends at the
    upper or lower edge is truncated by an unknown amount; one that ends at a side edge and is slimmer than
    people are is truncated as well. For boxes beyond a side edge the area accounts for it.

    Args:
        boxes: (..., 4) pixels, without hidden ones.
        picture_boxes: (..., 4) each camera's own picture, pixels; broadcast to `boxes`.

    Returns:
        (...) values in [0, 1].
    """
    inside = area_ratios(areas_inside_picture(boxes, picture_boxes), areas(boxes))
    left, top, right, bottom = np.moveaxis((boxes - picture_boxes) * np.array([1.0, 1.0, -1.0, -1.0]), -1, 0)
    height = boxes[..., 3] - boxes[..., 1]
    at_top_or_bottom = _edge_proximity(np.minimum(top, bottom), height)
    at_side = np.minimum(left, right)
    at_side = np.where(at_side < 0.0, 0.0, _edge_proximity(at_side, height))
    width_ratio = np.minimum(area_ratios(boxes[..., 2] - boxes[..., 0], _UPRIGHT_ASPECT_RATIO * height), 1.0)
    return np.asarray(
        inside * (1.0 - _EDGE_PENALTY * at_top_or_bottom) * (1.0 - at_side * (1.0 - width_ratio))
    )


def _edge_proximity(gap: Floats, height: Floats) -> Floats:
    """Return how near (...) boxes are to an edge that is `gap` away: 1 at it or beyond, 0 clear of it."""
    margin = np.maximum(_EDGE_MARGIN * height, _MINIMUM_MARGIN)
    return np.asarray(1.0 - np.clip(gap / margin, 0.0, 1.0))
