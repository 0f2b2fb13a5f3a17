"""The foreground that MyView's own detector sees in every frame of a camera."""

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
from tracking.detectors.background.foreground_fit import ForegroundFit
from tracking.detectors.background.height_model import HeightModel
from tracking.detectors.base import Mask

CELL = 2
"""Pixels of the detector's working picture per cell, on each axis."""


@dataclass(frozen=True, slots=True, eq=False)
class ForegroundMasks:
    """What one camera's detector sees, frame by frame, in cells.

    Attributes:
        size: of the camera's picture.
        foreground: of each frame (H, W), the share of foreground, in 255ths; None: it could not tell.
        shadow: the same of what looks like a shadow, which tells nothing.
        weight: (H, W), 1 where the picture counts.
        line: how tall people are where, in pixels of the camera's picture, as it was known at last.
    """

    size: tuple[int, int]
    foreground: list[Mask | None]
    shadow: list[Mask | None]
    weight: Floats
    line: HeightModel


class CannotMapError(Exception):
    """There is no occupancy map; the text says why."""


def masks_of(config: Config, camera: str) -> ForegroundMasks:
    """Search a recording as a camera's process does, and keep the foreground.

    Raises:
        CannotMapError: it is not searched by its background, or how tall people are is never known.
    """
    pipeline = CameraPipeline(config, camera)
    detector = pipeline._detector  # noqa: SLF001 — the very masks that its boxes come from
    if not isinstance(detector, BackgroundDetector):
        raise CannotMapError(f"camera {camera} is not searched by its background")
    heard = _MaskRecorder(detector)
    detector._fit = heard  # type: ignore[method-assign]  # noqa: SLF001
    foreground: list[Mask | None] = []
    shadow: list[Mask | None] = []
    for pulse in count():
        try:
            pipeline.detect(pulse, pipeline.take(pulse))
        except SourceEndedError:
            break
        one, other = heard.last()
        foreground.append(one)
        shadow.append(other)
    pipeline.close()
    line, grid = detector.height_model, heard.grid
    if line is None or grid is None:
        raise CannotMapError(f"how tall people are in camera {camera} is never known")
    weight = np.asarray(_cells(grid.visible) > 127, dtype=np.float64)
    return ForegroundMasks(pipeline.source.size, foreground, shadow, weight, line.in_cells(grid.scale, 0.0))


class _MaskRecorder:
    """Stands before a detector's search for people, and keeps what that is given."""

    def __init__(self, detector: BackgroundDetector) -> None:
        self._search = detector._fit  # noqa: SLF001
        self._last: tuple[Mask | None, Mask | None] = (None, None)
        self.grid: CellGrid | None = None

    def __call__(self, mask: Mask, shadow: Mask, grid: CellGrid) -> ForegroundFit:
        """Search."""
        self.grid = grid
        self._last = _cells(mask), _cells(shadow)
        return self._search(mask, shadow, grid)

    def last(self) -> tuple[Mask | None, Mask | None]:
        """Return the frame's foreground and shadow, once."""
        last, self._last = self._last, (None, None)
        return last


def _cells(mask: NDArray[np.uint8]) -> Mask:
    height, width = mask.shape
    size = (width // CELL, height // CELL)
    return np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
