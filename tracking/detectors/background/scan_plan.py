"""Scan positions per height, planned once per height model."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats
from tracking.detectors.background.silhouette import BodyPart
from tracking.detectors.base import Plane

# Scan steps per box height; `BoxFilter` refines the positions between them.
STEPS_PER_HEIGHT = 16
# Neighborhood of a peak, in shares of the box's height and width.
_PEAK_ROWS, _PEAK_COLUMNS = 0.1, 0.25


@dataclass(frozen=True, slots=True)
class Extent:
    """The rows and columns in which a plane has cells above 0; the ends are excluded."""

    top: int
    bottom: int
    left: int
    right: int


def positive_extent(plane: Plane) -> Extent:
    """Return the extent of the cells of a plane `(H, W)` that are above 0; empty if there are none."""
    positive = plane > 0.0
    rows, columns = np.flatnonzero(positive.any(axis=1)), np.flatnonzero(positive.any(axis=0))
    if not rows.size:
        return Extent(0, 0, 0, 0)
    return Extent(int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1)


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
        step: cells between two positions, on each axis.
        parts: `(left, top, right, bottom)` of each part from the top left corner, in cells.
    """

    size: tuple[int, int]
    tops: npt.NDArray[np.int64]
    lefts: npt.NDArray[np.int64]
    gain_factors: Floats
    min_gain: float
    neighborhood: npt.NDArray[np.uint8]
    step: int
    parts: tuple[tuple[int, int, int, int], ...]

    def peaks(self, sums: Floats, extent: Extent) -> tuple[Floats, Floats]:
        """Return the local maxima of the gain with integral image `sums`: boxes `(P, 4)` and gains `(P,)`.

        Only bodies that reach into the `extent` of the cells with a gain are tried.
        """
        width, height = self.size
        rows = _reaching(self.tops, height, extent.top, extent.bottom, self.step)
        columns = _reaching(self.lefts, width, extent.left, extent.right, self.step)
        tops, lefts = self.tops[rows], self.lefts[columns]
        if not (len(tops) and len(lefts)):
            return _NO_BOXES, _NO_GAINS

        def at(first: int, count: int) -> slice:
            return slice(first, first + (count - 1) * self.step + 1, self.step)

        gains = np.zeros((len(tops), len(lefts)))
        for part_left, part_top, part_right, part_bottom in self.parts:
            upper, lower = at(tops[0] + part_top, len(tops)), at(tops[0] + part_bottom, len(tops))
            left, right = at(lefts[0] + part_left, len(lefts)), at(lefts[0] + part_right, len(lefts))
            gains += sums[lower, right]
            gains -= sums[upper, right]
            gains -= sums[lower, left]
            gains += sums[upper, left]
        gains *= self.gain_factors[rows]
        if gains.max() < self.min_gain:
            return _NO_BOXES, _NO_GAINS
        highest = cv2.dilate(gains, self.neighborhood, borderType=cv2.BORDER_REPLICATE)
        found = np.flatnonzero((gains >= highest) & (gains >= self.min_gain))
        row, column = np.divmod(found, len(lefts))
        x, y = lefts[column], tops[row]
        boxes = np.stack([x, y, x + width, y + height], axis=1).astype(np.float64)
        return boxes, gains.ravel()[found]


_NO_BOXES, _NO_GAINS = np.empty((0, 4)), np.empty(0)


def _reaching(begins: npt.NDArray[np.int64], length: int, first: int, end: int, step: int) -> slice:
    """Return which intervals of a length, that begin every `step` cells, reach into `first` to `end`."""
    return slice(
        max((first - length - int(begins[0])) // step + 1, 0), max(-(-(end - int(begins[0])) // step), 0)
    )


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

    return HeightPlan(
        size=size,
        tops=tops,
        lefts=lefts,
        gain_factors=gain_factors[tops + height][:, None],
        min_gain=min_gain * area,
        neighborhood=np.ones(neighborhood, dtype=np.uint8),
        step=step,
        parts=tuple(
            (
                round(part.left * width),
                round(part.top * height),
                round(part.right * width),
                round(part.bottom * height),
            )
            for part in parts
        ),
    )
