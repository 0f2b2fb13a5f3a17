"""Scan positions per height, planned once per height model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats
from tracking.detectors.background.silhouette import BodyPart

# Scan steps per box height; `BoxFilter` refines the positions between them.
STEPS_PER_HEIGHT = 16
# Neighborhood of a peak, in shares of the box's height and width.
_PEAK_ROWS, _PEAK_COLUMNS = 0.1, 0.25

_GridSlice: TypeAlias = tuple[slice, slice]


@dataclass(frozen=True, slots=True, eq=False)
class HeightPlan:
    """The scan positions of bodies of one height, in cells.

    Attributes:
        size: width and height.
        tops: `(R,)` rows of the top left corners.
        lefts: `(C,)` their columns.
        gain_factors: `(R, 1)`, the factor on the gain in each row.
        min_gain: least gain of a peak.
        neighborhood: a peak is the maximum of this neighborhood, `(rows, columns)` of positions.
        corner_slices: for each part, slices of the integral image at its bottom right, top right, bottom
            left and top left corner, over all positions.
    """

    size: tuple[int, int]
    tops: npt.NDArray[np.int64]
    lefts: npt.NDArray[np.int64]
    gain_factors: Floats
    min_gain: float
    neighborhood: npt.NDArray[np.uint8]
    corner_slices: tuple[tuple[_GridSlice, _GridSlice, _GridSlice, _GridSlice], ...]

    def peaks(self, sums: Floats) -> tuple[Floats, Floats]:
        """Return the local maxima of the gain with integral image `sums`: boxes `(P, 4)` and gains `(P,)`."""
        gains = np.zeros((len(self.tops), len(self.lefts)))
        for right_bottom, right_top, left_bottom, left_top in self.corner_slices:
            gains += sums[right_bottom]
            gains -= sums[right_top]
            gains -= sums[left_bottom]
            gains += sums[left_top]
        gains *= self.gain_factors
        if gains.max() < self.min_gain:
            return _NO_BOXES, _NO_GAINS
        highest = cv2.dilate(gains, self.neighborhood, borderType=cv2.BORDER_REPLICATE)
        found = np.flatnonzero((gains >= highest) & (gains >= self.min_gain))
        rows, columns = np.divmod(found, len(self.lefts))
        left, top = self.lefts[columns], self.tops[rows]
        boxes = np.stack([left, top, left + self.size[0], top + self.size[1]], axis=1).astype(np.float64)
        return boxes, gains.ravel()[found]


_NO_BOXES, _NO_GAINS = np.empty((0, 4)), np.empty(0)


def plan_height(
    shape: tuple[int, int],
    size: tuple[int, int],
    parts: tuple[BodyPart, ...],
    gain_factors: Floats,
    min_gain: float,
) -> HeightPlan | None:
    """Plan the scan of one height; `None` if no such body is possible.

    Args:
        shape: rows and columns of the plane, in cells.
        size: width and height of the boxes, in cells.
        parts: the body parts, in shares of the box.
        gain_factors: `(H,)` the factor on the gain for each foot row, 0 where this height is impossible.
        min_gain: least gain of a peak, as a share of the body's area.
    """
    width, height = size
    step = max(1, height // STEPS_PER_HEIGHT)
    tops, lefts = np.arange(0, shape[0] - height, step), np.arange(0, shape[1] - width, step)
    possible = np.flatnonzero(gain_factors[tops + height])
    if not (possible.size and lefts.size):
        return None
    tops = tops[possible[0] : possible[-1] + 1]
    area = sum((part.right - part.left) * (part.bottom - part.top) for part in parts) * width * height
    neighborhood = (
        2 * max(int(_PEAK_ROWS * height / step), 1) + 1,
        2 * max(int(_PEAK_COLUMNS * width / step), 1) + 1,
    )

    def grid_slice(along: float, down: float) -> _GridSlice:
        x, y = round(along * width), round(down * height)
        rows = slice(int(tops[0]) + y, int(tops[-1]) + y + 1, step)
        return rows, slice(int(lefts[0]) + x, int(lefts[-1]) + x + 1, step)

    return HeightPlan(
        size=size,
        tops=tops,
        lefts=lefts,
        gain_factors=gain_factors[tops + height][:, None],
        min_gain=min_gain * area,
        neighborhood=np.ones(neighborhood, dtype=np.uint8),
        corner_slices=tuple(
            (
                grid_slice(part.right, part.bottom),
                grid_slice(part.right, part.top),
                grid_slice(part.left, part.bottom),
                grid_slice(part.left, part.top),
            )
            for part in parts
        ),
    )
