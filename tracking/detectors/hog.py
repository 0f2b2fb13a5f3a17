"""OpenCV's HOG people detector with a linear SVM (Dalal and Triggs, CVPR 2005)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Image, validate_image
from tracking.detectors.color_histogram import AppearanceExtractor
from tracking.detectors.ignore_mask import IgnoreFilter, Polygons
from tracking.detectors.non_maximum_suppression import non_maximum_suppression
from tracking.image_scaling import scale_image
from tracking.types import Detections

# The detector's window is 64x128 pixels, the person in its middle is 96 tall, with 16 above and below.
_PERSON_ROWS = 96
_MARGIN = 0.125
_STRIDE = (8, 8)
_PADDING = (16, 16)
# Width over height of a person's box: the window is much wider than most people.
_ASPECT = 0.38


@dataclass(frozen=True, slots=True)
class HogSettings:
    """The HOG people detector.

    Raises:
        ValueError: a setting is out of range.
    """

    min_height: float = 0.14  # smallest person, in image heights; smaller is slower
    scale_step: float = 1.08  # factor between two sizes of the scan
    min_margin: float = (
        0.0  # least distance from the SVM's boundary; below 0 detects more people and more false positives
    )
    nms_iou: float = 0.5  # overlap (IoU) above which the box of lower score is dropped
    max_detections: int = 40  # most boxes per frame

    def __post_init__(self) -> None:
        if not 0.0 < self.min_height <= 1.0:
            raise ValueError(f"min_height is a share above 0 up to 1, not {self.min_height}")
        if not self.scale_step > 1.0:
            raise ValueError(f"scale_step must be above 1, not {self.scale_step}")


class HogDetector:
    """Detects upright people in single images, without memory."""

    warming_up = False

    def __init__(
        self,
        settings: HogSettings | None = None,
        appearance: AppearanceExtractor | None = None,
        ignore: Polygons = (),
    ) -> None:
        self.settings = settings or HogSettings()
        self._appearance = appearance or AppearanceExtractor()
        self._ignore_filter = IgnoreFilter(ignore)
        self._hog = cv2.HOGDescriptor()
        self._hog.setSVMDetector(np.asarray(cv2.HOGDescriptor.getDefaultPeopleDetector(), dtype=np.float32))

    @property
    def appearance_bins(self) -> int:
        """The length of a row of the histograms."""
        return self._appearance.bins

    def detect(self, image: Image, frame: int | None = None) -> Detections:  # noqa: ARG002 — Detector
        """Return the people detected in a frame, best first.

        Raises:
            ValueError: not an `(H, W, 3)` uint8 image.
        """
        validate_image(image)
        boxes, scores = self._positive_windows(image)
        visible = self._ignore_filter.keep(image.shape, boxes)
        boxes, scores = boxes[visible], scores[visible]
        kept = non_maximum_suppression(boxes, scores, self.settings.nms_iou, self.settings.max_detections)
        boxes = boxes[kept]
        return Detections(boxes, scores[kept], self._appearance.histograms(image, boxes))

    def _positive_windows(self, image: Image) -> tuple[Floats, Floats]:
        """Return the boxes of people in the SVM's positive windows, and their scores."""
        height, width = image.shape[:2]
        factor = _PERSON_ROWS / (self.settings.min_height * height)
        size = (max(round(width * factor), 64), max(round(height * factor), 128))
        scaled = scale_image(image, size)
        windows, margins = self._hog.detectMultiScale(
            scaled,
            hitThreshold=self.settings.min_margin,
            winStride=_STRIDE,
            padding=_PADDING,
            scale=self.settings.scale_step,
            groupThreshold=0,
        )
        sides = np.asarray(windows, dtype=np.float64).reshape(-1, 4)
        per_pixel = np.array([width / size[0], height / size[1]])
        corner, extent = sides[:, :2] * per_pixel, sides[:, 2:] * per_pixel
        person_height = (1.0 - 2.0 * _MARGIN) * extent[:, 1]
        top = corner[:, 1] + _MARGIN * extent[:, 1]
        center, half = corner[:, 0] + extent[:, 0] / 2.0, _ASPECT * person_height / 2.0
        boxes = np.stack([center - half, top, center + half, top + person_height], axis=1)
        limits = np.array([width, height] * 2, dtype=np.float64)
        scores = 1.0 / (1.0 + np.exp(-np.asarray(margins, dtype=np.float64).ravel()))
        return np.clip(boxes, 0.0, limits), scores
