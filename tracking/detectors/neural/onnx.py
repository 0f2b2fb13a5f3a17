"""Neural detector: any YOLO-style ONNX network, run by onnxruntime."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Image, Relight, validate_image
from tracking.detectors.color_histogram import AppearanceExtractor
from tracking.detectors.ignore_mask import IgnoreFilter, Polygons
from tracking.detectors.neural.providers import Provider
from tracking.detectors.neural.session import Planes, open_session
from tracking.detectors.neural.yolo_output import Layout, decode_output
from tracking.detectors.non_maximum_suppression import non_maximum_suppression
from tracking.image_scaling import scale_image
from tracking.types import Detections

# Gray level of the letterbox bars, as in YOLO's training.
_BAR_LEVEL = 114
_MIN_SCORE = 0.25


@dataclass(frozen=True, slots=True)
class OnnxSettings:
    """A YOLO-style network in an ONNX file.

    Raises:
        ValueError: a setting is out of range.
    """

    model: Path | None = None  # path of the file
    output_layout: Layout = "auto"  # layout of the output: yolov5, yolov8, end2end; auto: by its shape
    classes: tuple[int, ...] = (0,)  # class numbers of people: 0 in COCO
    min_score: float | None = None  # boxes below this score are dropped; None: 0.25
    nms_iou: float = 0.7  # overlap (IoU) above which the box of lower score is dropped
    resize: Literal["letterbox", "stretch"] = (
        "letterbox"  # fit images into the input with bars, or stretch them
    )
    input_size: int = 640  # side of the input in pixels, if the file leaves it open
    provider: Provider = "auto"  # what runs the network: the first that works, cuda, openvino, coreml, cpu
    threads: int = 1  # threads of the network; each camera has its own process
    max_detections: int = 100  # most boxes per frame

    def __post_init__(self) -> None:
        if not self.classes or min(self.classes) < 0:
            raise ValueError(f"classes are numbers from 0, at least one, not {list(self.classes)}")
        if self.min_score is not None and not 0.0 <= self.min_score <= 1.0:
            raise ValueError(f"min_score is a share between 0 and 1, not {self.min_score}")
        if self.input_size < 1 or self.threads < 1 or self.max_detections < 1:
            raise ValueError("input_size, threads and max_detections must be at least 1")


class OnnxDetector:
    """Detects people with an ONNX network, without memory.

    Raises:
        ValueError: no file is given, or it is not a network with an image input and YOLO's output.
        OSError: the file cannot be read.
        ImportError: onnxruntime is not installed.
    """

    warming_up = False

    def __init__(
        self, settings: OnnxSettings, appearance: AppearanceExtractor | None = None, ignore: Polygons = ()
    ) -> None:
        self.settings = settings
        self._appearance = appearance or AppearanceExtractor()
        self._ignore_filter = IgnoreFilter(ignore)
        if settings.model is None:
            raise ValueError("no model is given: the path of an ONNX file")
        self._session = open_session(settings.model, settings.provider, settings.threads, settings.input_size)
        # Run a blank image, to detect an unusable network before the first frame.
        try:
            self.detect(np.zeros((*self._session.size, 3), dtype=np.uint8))
        except ValueError as error:
            raise ValueError(f"{settings.model}: {error}") from error

    @property
    def provider(self) -> str:
        """What runs the network: onnxruntime's execution provider."""
        return self._session.provider

    @property
    def failed_providers(self) -> tuple[str, ...]:
        """Preferred providers that could not be used, each with the reason."""
        return self._session.failures

    @property
    def appearance_bins(self) -> int:
        """The length of a row of the histograms."""
        return self._appearance.bins

    def detect(self, image: Image, frame: int | None = None) -> Detections:  # noqa: ARG002 — Detector
        """Return the people detected in a frame, best first.

        Raises:
            ValueError: not an `(H, W, 3)` uint8 image, or the network's output is not a YOLO output.
        """
        found = self.find(image)
        return replace(found, histograms=self._appearance.histograms(image, found.boxes))

    def find(self, image: Image, relight: Relight | None = None) -> Detections:
        """Return the people detected in an image, best first, without their appearance.

        Args:
            image: `(H, W, 3)`.
            relight: changes the light of the image once it is reduced to the network's input.

        Raises:
            ValueError: not an `(H, W, 3)` uint8 image, or the network's output is not a YOLO output.
        """
        validate_image(image)
        planes, scale, offset = self._fit_to_input(image, relight)
        found = decode_output(self._session.run(planes), self.settings.output_layout, self.settings.classes)
        limits = np.array([image.shape[1], image.shape[0]] * 2, dtype=np.float64)
        boxes = np.clip((found.boxes - offset) / scale, 0.0, limits)
        min_score = _MIN_SCORE if self.settings.min_score is None else self.settings.min_score
        kept = (found.scores >= min_score) & self._ignore_filter.keep(image.shape, boxes)
        boxes, scores = boxes[kept], found.scores[kept]
        best = non_maximum_suppression(boxes, scores, self.settings.nms_iou, self.settings.max_detections)
        return Detections(boxes[best], scores[best], np.empty((len(best), 0)))

    def _fit_to_input(self, image: Image, relight: Relight | None) -> tuple[Planes, Floats, Floats]:
        """Resize the image into the center of the input `(1, 3, h, w)`, RGB, 0 to 1, and relight it there.

        Returns the input, and the scale and the offset of the image, both `(4,)` as for a box.
        """
        height, width = self._session.size
        scales = width / image.shape[1], height / image.shape[0]
        if self.settings.resize == "letterbox":
            scales = min(scales), min(scales)
        scaled_width, scaled_height = round(image.shape[1] * scales[0]), round(image.shape[0] * scales[1])
        left, top = (width - scaled_width) // 2, (height - scaled_height) // 2
        canvas = np.full((height, width, 3), _BAR_LEVEL, dtype=np.uint8)
        reduced = scale_image(image, (scaled_width, scaled_height))
        canvas[top : top + scaled_height, left : left + scaled_width] = (
            reduced if relight is None else relight(reduced)
        )
        planes = cv2.dnn.blobFromImage(canvas, scalefactor=1.0 / 255.0, swapRB=True)
        return (
            planes.astype(self._session.element, copy=False),
            np.array(scales * 2),
            np.array([left, top] * 2, dtype=np.float64),
        )
