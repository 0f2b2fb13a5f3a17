"""Detector that reads a MOTChallenge file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from tracking.appearance import gray_histograms
from tracking.boxes import BOX_SIDES, iou
from tracking.detectors.base import Image
from tracking.motchallenge import MotRow, read_rows
from tracking.types import Detections


@dataclass(frozen=True, slots=True)
class MotFileSettings:
    """Settings of detections from a file."""

    bins: int = 64  # bins of the gray histograms, if there is an image
    min_score: float = 0.0  # detections below this score (0..1, see `MotFileDetector`) are dropped
    nms_iou: float = 0.7  # overlap (IoU) above which the detection of lower score is dropped
    first_frame: int = 0  # frame number (pulse) of the file's frame 1


_FULL_SCORE_QUANTILE = 0.9
"""Quantile of confidences in an unknown unit that becomes score 1."""


class MotFileDetector:
    """Reads detections from a file frame by frame; histograms are computed from the image.

    Confidences become scores in [0, 1]. If any lies outside, all are rescaled linearly, from the smallest in
    the file to 0 and from the 0.9 quantile to 1: the unit is not stated, and a few may be far above the
    others. Without pixels (an empty `image`) histograms have no bins.

    Raises:
        ValueError: the file is no MOTChallenge text.
        OSError: the file cannot be read.
    """

    def __init__(self, path: Path, settings: MotFileSettings | None = None) -> None:
        self.settings = settings or MotFileSettings()
        self._frames = _by_frame(read_rows(path))
        self._next = self.settings.first_frame

    @property
    def last_frame(self) -> int:
        """The last frame number with a detection."""
        return self.settings.first_frame + max(self._frames, default=0) - 1

    def detect(self, image: Image, frame: int | None = None) -> Detections:
        """Return the detections of the frame; none if the file has none."""
        number = self._next if frame is None else frame
        self._next = number + 1
        bins = self.settings.bins if image.size else 0
        rows = self._frames.get(number - self.settings.first_frame + 1)
        if rows is None:
            return Detections.empty(bins)
        keep = _select_rows(rows, self.settings)
        boxes, scores = rows[keep, :BOX_SIDES], rows[keep, BOX_SIDES]
        if not bins:
            return Detections(boxes, scores, np.empty((len(boxes), 0)))
        gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        return Detections(boxes, scores, gray_histograms(gray, boxes, bins))


def _by_frame(rows: Sequence[MotRow]) -> dict[int, np.ndarray[tuple[int, int], np.dtype[np.float64]]]:
    """Return the rows `left, top, right, bottom, score` of each frame, best first."""
    confidences = [row.confidence for row in rows]
    low, high = 0.0, 1.0
    if confidences and not (min(confidences) >= 0.0 and max(confidences) <= 1.0):
        low, high = min(confidences), float(np.quantile(confidences, _FULL_SCORE_QUANTILE, method="higher"))
    spread = high - low
    frames: dict[int, list[tuple[float, ...]]] = {}
    for row in rows:
        score = min((row.confidence - low) / spread, 1.0) if spread > 0.0 else 1.0
        frames.setdefault(row.frame, []).append((*row.box, score))
    return {
        number: np.array(sorted(found, key=lambda row: (-row[-1], *row)), dtype=np.float64)
        for number, found in frames.items()
    }


def _select_rows(
    rows: np.ndarray[tuple[int, int], np.dtype[np.float64]], settings: MotFileSettings
) -> list[int]:
    kept: list[int] = []
    for index, row in enumerate(rows):
        if row[BOX_SIDES] < settings.min_score:
            break
        overlaps = iou(rows[kept, :BOX_SIDES], row[:BOX_SIDES])
        if overlaps.max(initial=0.0) <= settings.nms_iou:
            kept.append(index)
    return kept
