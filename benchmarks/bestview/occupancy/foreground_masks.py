"""The foreground masks of MyView's detector, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count

import cv2
import numpy as np
from numpy.typing import NDArray

from server.camera.pipeline import CameraPipeline
from server.camera.sources import SourceEndedError
from server.config.site_config import Config
from tracking.boxes import Floats
from tracking.detectors import BackgroundDetector
from tracking.detectors.background.cell_grid import CellGrid
from tracking.detectors.background.detector import ForegroundScan
from tracking.detectors.background.height_model import HeightModel
from tracking.detectors.base import Image, Mask

CELL = 2
"""Pixels of the detector's working picture per cell, on each axis."""


@dataclass(frozen=True, slots=True, eq=False)
class ForegroundMasks:
    """The masks of one camera's detector, frame by frame, in cells.

    Attributes:
        size: of the camera's picture.
        foreground: of each frame (H, W), the share of foreground, in 255ths; None: unknown.
        shadow: the same of shadows, which are ignored.
        weight: (H, W), 1 where the picture is not ignored.
        height_model: the final height model, in pixels of the camera's picture.
    """

    size: tuple[int, int]
    foreground: list[Mask | None]
    shadow: list[Mask | None]
    weight: Floats
    height_model: HeightModel


class CannotMapError(Exception):
    """No occupancy map can be computed; the text gives the reason."""


def compute_masks(config: Config, camera: str) -> ForegroundMasks:
    """Detect people in a recording as a camera process does, and keep the foreground.

    Raises:
        CannotMapError: the detector is not the background detector, or never learns the heights of people.
    """
    pipeline = CameraPipeline(config, camera)
    detector = pipeline._detector  # noqa: SLF001 — its boxes come from these masks
    if not isinstance(detector, BackgroundDetector):
        raise CannotMapError(f"camera {camera} has no background detector")
    recorder = _MaskRecorder(detector)
    detector._scan_mask = recorder  # type: ignore[method-assign]  # noqa: SLF001
    foreground: list[Mask | None] = []
    shadow: list[Mask | None] = []
    for pulse in count():
        try:
            pipeline.detect(pulse, pipeline.take(pulse))
        except SourceEndedError:
            break
        foreground_mask, shadow_mask = recorder.last()
        foreground.append(foreground_mask)
        shadow.append(shadow_mask)
    pipeline.close()
    height_model, grid = detector.height_model, recorder.grid
    if height_model is None or grid is None:
        raise CannotMapError(f"camera {camera}: the heights of people were never learned")
    weight = np.asarray(_cells(grid.visible) > 127, dtype=np.float64)
    return ForegroundMasks(
        pipeline.source.size, foreground, shadow, weight, height_model.in_cells(grid.work_scale, 0.0)
    )


class _MaskRecorder:
    """Wraps a detector's scan of the foreground, and keeps its masks."""

    def __init__(self, detector: BackgroundDetector) -> None:
        self._search = detector._scan_mask  # noqa: SLF001
        self._last: tuple[Mask | None, Mask | None] = (None, None)
        self.grid: CellGrid | None = None

    def __call__(self, work_image: Image, mask: Mask, shadow: Mask, grid: CellGrid) -> ForegroundScan:
        """Scan the foreground for people."""
        self.grid = grid
        self._last = _cells(mask), _cells(shadow)
        return self._search(work_image, mask, shadow, grid)

    def last(self) -> tuple[Mask | None, Mask | None]:
        """Return and forget the frame's foreground and shadow."""
        last, self._last = self._last, (None, None)
        return last


def _cells(mask: NDArray[np.uint8]) -> Mask:
    height, width = mask.shape
    size = (width // CELL, height // CELL)
    return np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
