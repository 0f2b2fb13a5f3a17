"""Boxes of a standing person's proportions over position and scale (paper IV.A.2)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Plane
from tracking.detectors.heightline import HeightLine
from tracking.detectors.silhouette import BODIES, Body, Corners, Part, corners_of, integral


@dataclass(frozen=True, slots=True)
class BoxFilterSettings:
    """The scan for standing people."""

    body: Body = "person"  # person: head, trunk and legs inside the box; box: all of it (the paper)
    aspect: float = 0.38  # width of a person's box over its height
    least_height: float = 0.14  # smallest person, in picture heights
    most_height: float = 0.95  # tallest person, in picture heights
    height_step: float = 1.08  # each height of the scan is this factor above the one before
    background_cost: float = 0.35  # what a background pixel inside the body costs, a foreground one brings 1
    least_gain: float = 0.3  # least gain of a hypothesis, in areas of its body
    least_seen: float = 0.45  # least share of a box that is inside the picture and not ignored
    most_peaks: int = 120  # local maxima kept for what follows, best first


@dataclass(frozen=True, slots=True, eq=False)
class Peaks:
    """Local maxima of the scan over x, y and scale, best first.

    Attributes:
        boxes: `(P, 4)` in cells.
        gains: `(P,)`, what the cells of the body add up to.
        sizes: `(P,)`, how many cells of the body count, at least 1.
        priors: `(P,)`, the factor by which the height lessens a gain, 1 where it is the expected one.
        corners: the bodies' parts.
    """

    boxes: npt.NDArray[np.float64]
    gains: npt.NDArray[np.float64]
    sizes: npt.NDArray[np.float64]
    priors: npt.NDArray[np.float64]
    corners: Corners


@dataclass(frozen=True, slots=True)
class Band:
    """Heights near the height line, both in cells."""

    line: HeightLine
    tolerance: float  # share by which a height may differ from the line
    doubt: float  # standard deviations of the line by which it may differ besides

    def priors(
        self, feet: npt.NDArray[np.float64], height: float | npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """Give the factor on the gain at each foot row: 1 on the line, 0 where the height is impossible.

        A height at the edge of what is possible counts for `1 - _EDGE` of one on the line.
        """
        expected = self.line.at(feet)
        allowed = np.maximum(self.tolerance * expected + self.doubt * self.line.doubt(feet), 1.0)
        away = np.abs(height - expected) / allowed
        return np.where((away <= 1.0) & (expected > 0.0), 1.0 - _EDGE * away**2, 0.0)


# What a height at the edge of the band loses of its gain.
_EDGE = 0.3


def find_peaks(
    gain: Plane,
    weight: Plane,
    settings: BoxFilterSettings,
    heights: npt.NDArray[np.float64],
    band: Band | None,
) -> Peaks:
    """Scan all places and heights and keep the local maxima, best first.

    Args:
        gain: `(H, W)`, what each cell adds to a body that covers it.
        weight: `(H, W)`, 1 where the picture counts.
        settings: the scan.
        heights: `(S,)` heights to try, in cells.
        band: where it is known, which heights are possible at which foot.
    """
    sums = _Sums(integral(gain), integral(weight))
    found = [_scan(sums, int(height), settings, band) for height in heights]
    boxes = np.concatenate([peaks.boxes for peaks in found])
    gains = np.concatenate([peaks.gains for peaks in found])
    order = _best_first(boxes, gains)[: settings.most_peaks]
    return _refined(boxes[order], sums, settings, band)


def _best_first(boxes: npt.NDArray[np.float64], gains: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Order by gain; equal ones by place, so that the order never depends on the sort."""
    return np.lexsort((boxes[:, 3], boxes[:, 1], boxes[:, 0], -gains))


def _refined(
    boxes: npt.NDArray[np.float64], sums: _Sums, settings: BoxFilterSettings, band: Band | None
) -> Peaks:
    """Move each box to the best place between those of the scan, step by half a step."""
    parts = BODIES[settings.body]
    step = np.maximum((boxes[:, 3] - boxes[:, 1]) // _STEPS, 1.0)
    while (step := step // 2).any():
        moved = boxes[:, None] + step[:, None, None] * _MOVES
        gains, priors = _measured(moved.reshape(-1, 4), sums, parts, band)
        best = np.argmax((gains * priors).reshape(len(boxes), len(_MOVES)), axis=1)
        boxes = moved[np.arange(len(boxes)), best]
    gains, priors = _measured(boxes, sums, parts, band)
    order = _best_first(boxes, gains * priors)
    corners = corners_of(boxes[order], parts, _shape(sums))
    sizes = np.maximum(corners.sums(sums.weight), 1.0)
    return Peaks(boxes[order], gains[order], sizes, priors[order], corners)


def _measured(
    boxes: npt.NDArray[np.float64], sums: _Sums, parts: tuple[Part, ...], band: Band | None
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Give the gains and priors of boxes."""
    gains = corners_of(boxes, parts, _shape(sums)).sums(sums.gain)
    if band is None:
        return gains, np.ones(len(boxes))
    return gains, band.priors(boxes[:, 3], boxes[:, 3] - boxes[:, 1])


def _shape(sums: _Sums) -> tuple[int, int]:
    return sums.gain.shape[0] - 1, sums.gain.shape[1] - 1


# Steps of the scan in a box's height.
_STEPS = 30
# Where a box is looked for around a place of the scan; first where it is.
_MOVES = np.array([(x, y, x, y) for y in (0, -1, 1) for x in (0, -1, 1)], dtype=np.float64)


def scan_heights(rows: int, settings: BoxFilterSettings) -> npt.NDArray[np.float64]:
    """Give the heights to try in a picture of so many rows of cells, `(S,)`, whole cells, ascending."""
    least, most = settings.least_height * rows, settings.most_height * rows
    steps = int(np.floor(np.log(most / least) / np.log(settings.height_step))) + 1
    return np.unique(np.rint(least * settings.height_step ** np.arange(steps)))


@dataclass(frozen=True, slots=True, eq=False)
class _Sums:
    gain: npt.NDArray[np.float64]
    weight: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """A regular grid of top left corners."""

    tops: npt.NDArray[np.int64]
    lefts: npt.NDArray[np.int64]
    step: int

    def of(self, sums: npt.NDArray[np.float64], x: int, y: int) -> npt.NDArray[np.float64]:
        """Read an integral image `(x, y)` cells right of and below every place."""
        rows = slice(int(self.tops[0]) + y, int(self.tops[-1]) + y + 1, self.step)
        return sums[rows, int(self.lefts[0]) + x : int(self.lefts[-1]) + x + 1 : self.step]


def _scan(sums: _Sums, height: int, settings: BoxFilterSettings, band: Band | None) -> _Found:
    """Give the local maxima of the bodies of one height, gains with their priors."""
    width = max(round(settings.aspect * height), 2)
    # What a coarse grid misses `_refined` finds.
    step = max(1, height // _STEPS)
    tops = np.arange(0, sums.gain.shape[0] - height, step)
    lefts = np.arange(0, sums.gain.shape[1] - width, step)
    priors = np.ones(len(tops))
    if band is not None:
        priors = band.priors(tops + float(height), float(height))
        possible = np.flatnonzero(priors)
        kept = slice(int(possible[0]), int(possible[-1]) + 1) if possible.size else slice(0, 0)
        tops, priors = tops[kept], priors[kept]
    if not (tops.size and lefts.size):
        return _Found(np.empty((0, 4)), np.empty(0))
    places = _Places(tops, lefts, step)
    parts = BODIES[settings.body]
    body = sum((p.right - p.left) * (p.bottom - p.top) for p in parts) * width * height
    gains = sum(_part_sums(sums.gain, places, (width, height), part) for part in parts) * priors[:, None]
    reach = (2 * max(height // (10 * step), 1) + 1, 2 * max(width // (4 * step), 1) + 1)
    tallest = cv2.dilate(gains, np.ones(reach, dtype=np.uint8), borderType=cv2.BORDER_REPLICATE)
    row, column = np.nonzero((gains >= tallest) & (gains >= settings.least_gain * body))
    left, top = lefts[column], tops[row]
    seen = sums.weight[top + height, left + width] - sums.weight[top, left + width]
    seen += sums.weight[top, left] - sums.weight[top + height, left]
    kept = seen >= settings.least_seen * width * height
    boxes = np.stack([left, top, left + width, top + height], axis=1)[kept].astype(np.float64)
    return _Found(boxes, gains[row, column][kept])


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    boxes: npt.NDArray[np.float64]
    gains: npt.NDArray[np.float64]


def _part_sums(
    sums: npt.NDArray[np.float64], places: _Places, size: tuple[int, int], part: Part
) -> npt.NDArray[np.float64]:
    """Sum one part of a box of `size` (width, height) at every place of the grid, `(rows, columns)`."""
    width, height = size

    def at(along: float, down: float) -> npt.NDArray[np.float64]:
        return places.of(sums, round(along * width), round(down * height))

    upper = at(part.right, part.top) - at(part.left, part.top)
    return at(part.right, part.bottom) - at(part.left, part.bottom) - upper
