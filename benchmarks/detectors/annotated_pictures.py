"""Pictures with drawn boxes, to inspect detectors where there is no ground truth."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from benchmarks.detectors.compared_detectors import BLOBS, MYVIEW, PAPER, compared_detectors, run_detector
from benchmarks.detectors.scored_views import ScoredView
from tracking.detectors import Image
from tracking.motchallenge import MotRow

_DRAWN = (MYVIEW, PAPER, BLOBS)
_FRAMES = 900
_EVERY = 150
_PALETTE = ((60, 180, 75), (60, 60, 230), (0, 165, 255), (230, 50, 240), (240, 200, 0), (0, 220, 220))
_FAINT = (170, 170, 170)


def save_pictures(views: list[ScoredView], folder: Path) -> Iterator[Path]:
    """Write a sheet per view: each detector's hypotheses (gray) and tracks (a color for each) over time."""
    folder.mkdir(parents=True, exist_ok=True)
    for view in views:
        images = [image for frame, image in enumerate(view.images(_FRAMES)) if frame % _EVERY == _EVERY - 1]
        rows = []
        for detector_spec in compared_detectors():
            if detector_spec.name not in _DRAWN:
                continue
            run = run_detector(detector_spec, view, _FRAMES)
            drawn = []
            for index, image in enumerate(images):
                number = _EVERY * (index + 1)
                hypotheses = [row for row in run.hypotheses if row.frame == number]
                drawn.append(_draw(image, hypotheses, [row for row in run.tracks if row.frame == number]))
            rows.append(np.concatenate(drawn, axis=1))
        path = folder / f"{view.name}.png"
        cv2.imwrite(str(path), np.concatenate(rows, axis=0))
        yield path


def _draw(image: Image, hypotheses: list[MotRow], tracks: list[MotRow]) -> Image:
    canvas = image.copy()
    for row in hypotheses:
        _box(canvas, row, _FAINT, 1)
    for row in tracks:
        _box(canvas, row, _PALETTE[row.id % len(_PALETTE)], 2)
    return canvas


def _box(canvas: Image, row: MotRow, color: tuple[int, int, int], thickness: int) -> None:
    left, top, right, bottom = (round(side) for side in row.box)
    cv2.rectangle(canvas, (left, top), (right, bottom), color, thickness)
