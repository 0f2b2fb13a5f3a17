"""The compared detectors, and the tracks made of their detections."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from benchmarks.common.detector_names import detector_names, detector_settings
from benchmarks.detectors.scored_views import ScoredView
from tracking import CostSettings, Detections, OnlineTracker, WindowResult, WindowSettings, create_solver
from tracking.detectors import Detector, Image
from tracking.detectors.ignore_mask import Polygons, visible_mask
from tracking.motchallenge import MotRow

CONFIDENT = 0.4
"""Score from which a hypothesis of the background detector is confident."""


class BlobDetector:
    """The standard approach: MOG2 without shadows, opening and closing, connected components."""

    MIN_HEIGHT = 0.1  # in picture heights

    def __init__(self, ignore: Polygons) -> None:
        self._ignore = ignore
        self._model = cv2.createBackgroundSubtractorMOG2(500, 16.0, True)  # noqa: FBT003 — detectShadows
        self._visible: Image | None = None

    def detect(self, image: Image, frame: int | None = None) -> Detections:  # noqa: ARG002 — Detector
        """Return the boxes of connected components that are tall enough."""
        rows, columns = image.shape[:2]
        if self._visible is None:
            self._visible = visible_mask(rows, columns, self._ignore)
        mask = (self._model.apply(image) == 255).astype(np.uint8) & self._visible
        mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8))
        mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((9, 5), dtype=np.uint8))
        _, _, stats, _ = cv2.connectedComponentsWithStats(mask)
        tall = stats[1:][stats[1:, cv2.CC_STAT_HEIGHT] >= self.MIN_HEIGHT * rows].astype(np.float64)
        boxes = np.concatenate([tall[:, :2], tall[:, :2] + tall[:, 2:4]], axis=1)
        return Detections(boxes, np.ones(len(boxes)), np.empty((len(boxes), 0)))


MYVIEW, PAPER, BLOBS = "MyView", "the paper's box filters", "MOG2 + connected components"


@dataclass(frozen=True, slots=True)
class ComparedDetector:
    """A detector in the comparison.

    Attributes:
        name: in the table.
        detect: the section `detect` that names it; None: connected components, which MyView does not have.
        with_other_trackers: whether other trackers also get its boxes.
    """

    name: str
    detect: Mapping[str, Any] | None
    with_other_trackers: bool = True

    def make(self, view: ScoredView, size: tuple[int, int]) -> Detector:
        """Return the detector for images of `size` = (width, height)."""
        if self.detect is None:
            return BlobDetector(view.ignore)
        if self.detect["kind"] == "hog":
            return view.make_detector({**self.detect, "hog": {"min_height": view.min_height}}, size)
        return view.make_detector(self.detect, size)


_TITLES = {"background": MYVIEW, "boxes": PAPER, "hog": "OpenCV's HOG"}
"""Titles of kinds of detectors."""
_ALONE = ("boxes",)
"""Detectors whose boxes other trackers do not get."""


def compared_detectors() -> list[ComparedDetector]:
    """Return all detectors, with the networks that are installed, and connected components."""
    return [
        *(
            ComparedDetector(_TITLES.get(name, name), detector_settings(name), name not in _ALONE)
            for name in detector_names()
        ),
        ComparedDetector(BLOBS, None),
    ]


@dataclass(frozen=True, slots=True)
class DetectorRun:
    """The detections and tracks of a detector in a view."""

    hypotheses: list[MotRow]
    tracks: list[MotRow]
    frames: int
    detect_s: float
    """Processor time of all frames."""
    track_s: float


def run_detector(detector_spec: ComparedDetector, view: ScoredView, frames: int | None) -> DetectorRun:
    """Run a detector on a view, and the tracker on its detections."""
    height, width = next(view.images(1)).shape[:2]
    detector = detector_spec.make(view, (width, height))
    tracker = OnlineTracker(WindowSettings(), CostSettings(), create_solver("columns"))
    boxes: list[MotRow] = []
    tracks: list[MotRow] = []
    count, detect_s, track_s = 0, 0.0, 0.0
    for number, image in enumerate(view.images(frames)):
        start = time.process_time()
        found = detector.detect(image, number)
        middle = time.process_time()
        result = tracker.push(number, found)
        detect_s, track_s = detect_s + middle - start, track_s + time.process_time() - middle
        boxes += rows_of(number, found)
        tracks += newly_final_rows(result)
        count += 1
    tracks += newly_final_rows(tracker.flush())
    return DetectorRun(boxes, tracks, count, detect_s, track_s)


def rows_of(number: int, found: Detections) -> list[MotRow]:
    """Return a frame's detections as MOTChallenge rows."""
    return [
        MotRow.of_box(number + 1, -1, box, score)
        for box, score in zip(found.boxes.tolist(), found.scores.tolist(), strict=True)
    ]


def newly_final_rows(result: WindowResult | None) -> Iterable[MotRow]:
    """Yield the rows of the frames that a window makes final."""
    if result is None:
        return
    for track in result.tracks:
        for number in range(result.first, result.final_to + 1):
            box = track.boxes[number - result.first].tolist()
            if not np.isnan(box[0]):
                yield MotRow.of_box(number + 1, track.id, box)
