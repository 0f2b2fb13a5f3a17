"""Template matching detector: local peaks of the correlation (paper IV.A.1).

Sub-images serve as appearance, in the form of histograms: a pixel of value v in [0, 1] becomes the two
numbers v and 1 - v; those of all pixels, divided by the number of pixels, sum to 1. The intersection distance
of two such rows is the mean absolute difference of the sub-images, and the Bhattacharyya distance the
Hellinger distance of their pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats
from tracking.detectors.base import Image, validate_image
from tracking.detectors.color_histogram import AppearanceExtractor, AppearanceSettings
from tracking.types import Detections

_MIN_SIDE = 4
"""Least side of a template in pixels: smaller ones match everywhere."""
_CHANNELS = 3
_WHITE = 255.0


@dataclass(frozen=True, slots=True)
class SubimageSettings:
    """The size and colors of a sub-image.

    Raises:
        ValueError: a side has no pixel.
    """

    width: int = 12  # pixels
    height: int = 12  # pixels
    color: bool = True  # false: gray

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a sub-image has at least 1x1 pixels, not {self.width}x{self.height}")

    @property
    def length(self) -> int:
        """The length of a row."""
        return 2 * self.width * self.height * (_CHANNELS if self.color else 1)


def subimage_histograms(image: Image, boxes: Floats, settings: SubimageSettings) -> Floats:
    """Return the resized sub-image of each box as a row: `(K, B)`, rows sum to 1.

    Args:
        image: `(H, W, 3)`.
        boxes: `(K, 4)` in pixels, clipped to the image; the row of an empty box is uniform.
        settings: the sub-images' size.
    """
    rows = np.full((len(boxes), settings.length), 1.0 / settings.length)
    limits = np.array([image.shape[1], image.shape[0]] * 2, dtype=np.float64)
    for k, edges in enumerate(np.rint(np.clip(boxes, 0.0, limits)).astype(np.int64)):
        left, top, right, bottom = edges
        if right <= left or bottom <= top:
            continue
        size = (settings.width, settings.height)
        small = cv2.resize(image[top:bottom, left:right], size, interpolation=cv2.INTER_AREA)
        if not settings.color:
            small = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)
        values = small.ravel() / _WHITE
        rows[k] = np.concatenate([values, 1.0 - values]) / values.size
    return rows


@dataclass(frozen=True, slots=True)
class TemplateSettings:
    """Settings of template matching for one object.

    Raises:
        ValueError: a setting is out of range.
    """

    max_peaks: int = 80  # K: most peaks, best first
    min_score: float = 0.0  # least correlation of a peak, 0 to 1
    peak_distance: float = 0.06  # no other peak within this share of the template's width and height
    appearance: Literal["subimage", "gray", "color"] = (
        "subimage"  # the appearance histogram of an observation
    )
    bins: int = 64  # appearance gray: bins of the histogram
    color_bins: int = 16  # appearance color: bins of each of the six histograms
    subimage: SubimageSettings = field(default_factory=SubimageSettings)

    def __post_init__(self) -> None:
        if self.max_peaks < 1:
            raise ValueError(f"max_peaks must be at least 1, not {self.max_peaks}")
        if not 0.0 <= self.min_score <= 1.0:
            raise ValueError(f"min_score is a share between 0 and 1, not {self.min_score}")
        if self.peak_distance < 0.0:
            raise ValueError(f"peak_distance must not be negative, not {self.peak_distance}")


class TemplateDetector:
    """Detects one object by normalized cross-correlation with a template image.

    The peaks are observations of that object only: see `build_network_per_object` and `TemplateTracker`. The
    detector is stateless.

    Raises:
        ValueError: the template is not `(h, w, 3)` uint8, or smaller than 4 pixels on a side.
    """

    def __init__(self, template: Image, settings: TemplateSettings | None = None) -> None:
        self.settings = settings or TemplateSettings()
        self._template = validate_image(template)
        height, width = template.shape[:2]
        if min(height, width) < _MIN_SIDE:
            raise ValueError(f"a template has at least {_MIN_SIDE} pixels a side, not {width}x{height}")
        self._size = (width, height)
        # Odd, so that a peak is in the center of its neighborhood.
        sides = [2 * max(1, round(self.settings.peak_distance * side)) + 1 for side in (height, width)]
        self._neighborhood = np.ones(sides, dtype=np.uint8)
        self.histogram: Floats = self._histograms(self._template, np.array([[0.0, 0.0, width, height]]))[0]
        """`(B,)`, the template's appearance histogram, of the same kind as those of the observations."""

    @property
    def appearance_bins(self) -> int:
        """The length of a row of the histograms."""
        return len(self.histogram)

    def detect(self, image: Image, frame: int | None = None) -> Detections:  # noqa: ARG002 — Detector
        """Return the peaks of a frame, best first; boxes have the template's size, scores are correlations.

        Raises:
            ValueError: not an `(H, W, 3)` uint8 image, or smaller than the template.
        """
        validate_image(image)
        width, height = self._size
        if image.shape[0] < height or image.shape[1] < width:
            raise ValueError(
                f"a {width}x{height} template does not fit into an image of {image.shape[:2][::-1]}"
            )
        lefts, tops, scores = self._peaks(image)
        boxes = np.stack([lefts, tops, lefts + width, tops + height], axis=1).astype(np.float64)
        return Detections(boxes, scores, self._histograms(image, boxes))

    def _peaks(self, image: Image) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], Floats]:
        """Return left, top and score of the local maxima, best first."""
        match = cv2.matchTemplate(image, self._template, cv2.TM_CCOEFF_NORMED)
        # The correlation is undefined where the image has a single color.
        match = np.where(np.isfinite(match), np.clip(match, 0.0, 1.0), 0.0).astype(np.float32)
        highest = cv2.dilate(match, self._neighborhood, borderType=cv2.BORDER_CONSTANT, borderValue=0.0)
        peak = (match >= highest) & (match > 0.0) & (match >= self.settings.min_score)
        tops, lefts = np.nonzero(peak)
        scores = match[tops, lefts].astype(np.float64)
        # Best first, then by position, so that the order is well defined.
        order = np.lexsort((tops, lefts, -scores))[: self.settings.max_peaks]
        return lefts[order], tops[order], scores[order]

    def _histograms(self, image: Image, boxes: Floats) -> Floats:
        settings = self.settings
        if settings.appearance == "subimage":
            return subimage_histograms(image, boxes, settings.subimage)
        return AppearanceExtractor(
            AppearanceSettings(settings.appearance == "color", settings.color_bins), settings.bins
        ).histograms(image, boxes)
