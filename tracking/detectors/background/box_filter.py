"""Box filters: scan for bodies of standing people over position and scale (paper IV.A.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats
from tracking.detectors.background.height_model import HeightModel
from tracking.detectors.background.scan_plan import (
    STEPS_PER_HEIGHT,
    HeightPlan,
    plan_height,
    positive_extent,
)
from tracking.detectors.background.silhouette import (
    BODY_PARTS,
    Body,
    PartRectangles,
    integral_image,
    part_rectangles,
)
from tracking.detectors.base import Plane


@dataclass(frozen=True, slots=True)
class BoxFilterSettings:
    """Settings of the scan for standing people."""

    body: Body = "person"  # person: head, trunk and legs inside the box; box: the whole box (the paper)
    aspect_ratio: float = 0.38  # width of a person's box over its height
    min_height: float = 0.14  # smallest person, in image heights; see also height_model
    max_height: float = 0.95  # tallest person, in image heights
    height_step: float = 1.08  # factor between successive heights of the scan
    background_cost: float = 0.35  # cost of a background pixel inside the body; a foreground pixel gains 1
    min_gain: float = 0.3  # least gain of a box, as a share of its body's area
    min_visible: float = 0.45  # least share of a box that is inside the image and not ignored
    max_peaks: int = 240  # local maxima kept for the foreground fit, best first


@dataclass(frozen=True, slots=True, eq=False)
class ScanPeaks:
    """Local maxima of the scan over x, y and scale, best first.

    Attributes:
        boxes: `(P, 4)` in cells.
        gains: `(P,)`, the sum over the cells of the body.
        areas: `(P,)`, the number of visible cells of the body, at least 1.
        gain_factors: `(P,)`, the factor on the gain for the height, 1 at the expected height.
        parts: the bodies' parts.
    """

    boxes: Floats
    gains: Floats
    areas: Floats
    gain_factors: Floats
    parts: PartRectangles


@dataclass(frozen=True, slots=True)
class HeightRange:
    """Range of possible heights around the height model, in cells."""

    model: HeightModel
    tolerance: float  # share by which a height may differ from the model
    tolerance_std: float  # standard deviations of the model allowed in addition
    min_height: float  # smallest person, in image heights

    def gain_factors(self, foot_rows: Floats, height: float | Floats) -> Floats:
        """Return the factor on the gain at each foot row: 1 at the expected height, 0 where impossible.

        It falls to `1 - _EDGE` at the edge of the possible range.
        """
        expected = self.model.expected_height(foot_rows)
        allowed = np.maximum(
            self.tolerance * expected + self.tolerance_std * self.model.height_standard_deviation(foot_rows),
            1.0,
        )
        deviation = np.abs(height - expected) / allowed
        return np.where((deviation <= 1.0) & (expected > 0.0), 1.0 - _EDGE * deviation**2, 0.0)


# Share of the gain lost at the edge of the height range.
_EDGE = 0.3
# Offsets tried around a scan position, in steps; the first is the position itself.
_OFFSETS = np.array([(x, y, x, y) for y in (0, -1, 1) for x in (0, -1, 1)], dtype=np.float64)


class BoxFilter:
    """Scans planes of one size for the positions and heights of bodies with the largest gain.

    The gain of a body is the sum over its cells, times the factor for its height at its foot row.
    """

    def __init__(self, weight: Plane, rows: int, settings: BoxFilterSettings) -> None:
        """Prepare for planes like `weight` `(H, W)`, 1 in visible cells; the image has `rows` rows."""
        self._settings = settings
        self._parts = BODY_PARTS[settings.body]
        self.see(weight)
        self._shape = (weight.shape[0], weight.shape[1])
        self._rows = rows
        self._range: HeightRange | None = None
        self._plans: list[HeightPlan] | None = None

    def see(self, weight: Plane) -> None:
        """Change which cells are visible, `(H, W)`, 1 where they are."""
        self._weights = integral_image(weight)

    def peaks(self, gain: Plane, height_range: HeightRange | None) -> ScanPeaks:
        """Scan all positions and heights; return the local maxima, best first.

        Args:
            gain: `(H, W)`, the gain of each cell of a covering body.
            height_range: the possible heights by foot row; None: all.
        """
        if self._plans is None or height_range is not self._range:
            self._range, self._plans = height_range, self._plan_heights(height_range)
        sums = integral_image(gain)
        extent = positive_extent(gain)
        found = [plan.peaks(sums, extent) for plan in self._plans]
        boxes = np.concatenate([np.empty((0, 4)), *(positions for positions, _ in found)])
        gains = np.concatenate([np.empty(0), *(values for _, values in found)])
        order = _best_first(boxes, gains)[: self._settings.max_peaks]
        return self._refine(boxes[order], sums)

    def _plan_heights(self, height_range: HeightRange | None) -> list[HeightPlan]:
        foot_rows = np.arange(self._shape[0] + 1, dtype=np.float64)
        plans: list[HeightPlan] = []
        smallest = self._settings.min_height * self._rows
        if height_range is not None:
            smallest = min(smallest, max(height_range.min_height * self._rows, height_range.model.min_height))
        for height in heights_to_scan(self._rows, smallest, self._settings).astype(np.int64).tolist():
            size = max(round(self._settings.aspect_ratio * height), 2), height
            gain_factors = (
                np.ones(len(foot_rows))
                if height_range is None
                else height_range.gain_factors(foot_rows, float(height))
            )
            plan = plan_height(self._shape, size, self._parts, gain_factors, self._settings.min_gain)
            if plan is not None:
                plans.append(plan)
        return plans

    def _refine(self, boxes: Floats, sums: Floats) -> ScanPeaks:
        """Move each box to the best position between the scan's, halving the step each time."""
        step = np.maximum((boxes[:, 3] - boxes[:, 1]) // STEPS_PER_HEIGHT, 1.0)
        while (step := step // 2).any():
            moved = boxes[:, None] + step[:, None, None] * _OFFSETS
            gains, gain_factors, _ = self._measure(moved.reshape(-1, 4), sums)
            best = np.argmax((gains * gain_factors).reshape(len(boxes), len(_OFFSETS)), axis=1)
            boxes = moved[np.arange(len(boxes)), best]
        gains, gain_factors, corners = self._measure(boxes, sums)
        visible = part_rectangles(boxes, BODY_PARTS["box"], self._shape).sums(self._weights)
        extent = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
        order = _best_first(boxes, gains * gain_factors)
        order = order[(visible >= self._settings.min_visible * extent)[order]]
        sizes = np.maximum(corners.sums(self._weights), 1.0)
        return ScanPeaks(boxes[order], gains[order], sizes[order], gain_factors[order], corners.select(order))

    def _measure(self, boxes: Floats, sums: Floats) -> tuple[Floats, Floats, PartRectangles]:
        """Return the gains, gain factors and parts of boxes."""
        corners = part_rectangles(boxes, self._parts, self._shape)
        gains = corners.sums(sums)
        if self._range is None:
            return gains, np.ones(len(boxes)), corners
        return gains, self._range.gain_factors(boxes[:, 3], boxes[:, 3] - boxes[:, 1]), corners


def _best_first(boxes: Floats, gains: Floats) -> npt.NDArray[np.int64]:
    """Order by gain, then by position, so that the order is well defined."""
    return np.lexsort((boxes[:, 3], boxes[:, 1], boxes[:, 0], -gains))


def heights_to_scan(rows: int, smallest: float, settings: BoxFilterSettings) -> Floats:
    """Return the heights to scan, in cells, `(S,)`, ascending, from `smallest` on."""
    largest = settings.max_height * rows
    steps = int(np.floor(np.log(largest / smallest) / np.log(settings.height_step))) + 1
    return np.unique(np.rint(smallest * settings.height_step ** np.arange(steps)))
