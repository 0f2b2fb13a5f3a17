"""Coordinate systems of the background detector: camera image, working image, cells."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Image, Mask, Plane
from tracking.detectors.ignore_mask import Polygon, visible_mask


class CellGrid:
    """Sizes and conversions of one camera's pictures.

    Attributes:
        margin: cells added on every side, so that boxes may reach out of the picture.
        visible: `(h, w)` of the working picture, 0 where it is ignored.
        weight: `(H, W)` of cells with margin, 1 where the picture counts.
    """

    def __init__(
        self, size: tuple[int, int], work_width: int, cell: int, outside: float, ignore: Sequence[Polygon]
    ) -> None:
        height, width = size
        self._size = size
        scale = min(1.0, work_width / width)
        self._work = (max(round(height * scale), cell), max(round(width * scale), cell))
        self._cell = cell
        self.margin = round(outside * self._work[0] / cell)
        self.visible = visible_mask(*self._work, ignore, scale)
        self.weight: Plane = (self.cell_shares(self.visible) > 0.5).astype(np.float32)  # noqa: PLR2004 — half

    def resize(self, image: Image) -> Image:
        """Return the image at the working size, `(h, w, 3)`."""
        if image.shape[:2] == self._work:
            return image
        size = (self._work[1], self._work[0])
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def cell_shares(self, mask: Mask) -> Plane:
        """Return the share of the mask in each cell, 0 to 1, padded by the margin."""
        size = (self._work[1] // self._cell, self._work[0] // self._cell)
        shares = cv2.resize(mask, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255.0
        return np.pad(shares, self.margin)

    def cells_to_work(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Turn boxes in cells into boxes in pixels of the working picture, cut at its borders."""
        height, width = self._work
        per_cell = np.array([width / (width // self._cell), height / (height // self._cell)] * 2)
        limits = np.array([width, height, width, height], dtype=np.float64)
        return np.asarray(np.clip((boxes - self.margin) * per_cell, 0.0, limits))

    @property
    def rows(self) -> int:
        """The height of the working picture."""
        return self._work[0]

    @property
    def scale(self) -> float:
        """How many times as large as the camera's the working picture is."""
        return self._work[0] / self._size[0]

    def work_to_image(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Turn boxes in pixels of the working picture into boxes in pixels of the camera's picture."""
        per_pixel = np.array([self._size[1] / self._work[1], self._size[0] / self._work[0]] * 2)
        return np.asarray(boxes * per_pixel)
