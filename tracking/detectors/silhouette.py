"""The outline of a standing person, in three rectangles, so that integral images can measure it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Plane


@dataclass(frozen=True, slots=True)
class Part:
    """A rectangle in shares of a person's box: 0 is its left or top, 1 its right or bottom."""

    left: float
    top: float
    right: float
    bottom: float


BODY = (
    Part(0.32, 0.0, 0.68, 0.14),  # head
    Part(0.16, 0.14, 0.84, 0.52),  # trunk and arms
    Part(0.22, 0.52, 0.78, 1.0),  # legs
)
WHOLE = (Part(0.0, 0.0, 1.0, 1.0),)

Body = Literal["person", "box"]
BODIES: dict[Body, tuple[Part, ...]] = {"person": BODY, "box": WHOLE}


def integral(plane: Plane) -> npt.NDArray[np.float64]:
    """Give the sums over all rectangles that begin in the top left corner, `(H + 1, W + 1)`."""
    return np.asarray(cv2.integral(plane, sdepth=cv2.CV_64F))


def sums_at(
    sums: npt.NDArray[np.float64], boxes: npt.NDArray[np.float64], parts: tuple[Part, ...]
) -> npt.NDArray[np.float64]:
    """Sum a plane over the parts of each box, `(K,)`; `boxes` `(K, 4)` in cells, cut at the borders."""
    total = np.zeros(len(boxes))
    for left, top, right, bottom in (_cells(boxes, part, sums.shape) for part in parts):
        total += sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
    return total


def covered(
    shape: tuple[int, int], box: npt.NDArray[np.float64], parts: tuple[Part, ...]
) -> npt.NDArray[np.bool_]:
    """Give the cells inside the parts of one box `(4,)` in cells: `(H, W)` bool."""
    inside = np.zeros(shape, dtype=np.bool_)
    for part in parts:
        edges = _cells(box[None], part, (shape[0] + 1, shape[1] + 1))
        left, top, right, bottom = (int(edge[0]) for edge in edges)
        inside[top:bottom, left:right] = True
    return inside


def _cells(
    boxes: npt.NDArray[np.float64], part: Part, shape: tuple[int, ...]
) -> tuple[npt.NDArray[np.int64], ...]:
    width = boxes[:, 2] - boxes[:, 0]
    height = boxes[:, 3] - boxes[:, 1]
    edges = (
        (boxes[:, 0] + part.left * width, shape[1]),
        (boxes[:, 1] + part.top * height, shape[0]),
        (boxes[:, 0] + part.right * width, shape[1]),
        (boxes[:, 1] + part.bottom * height, shape[0]),
    )
    return tuple(np.clip(np.rint(edge), 0, size - 1).astype(np.int64) for edge, size in edges)
