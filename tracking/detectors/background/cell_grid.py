"""Coordinate systems of the background detector: camera image, working image, cells."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Image, Mask, Plane
from tracking.detectors.ignore_mask import Polygon, visible_mask
from tracking.image_scaling import scale_image


class CellGrid:
    """Sizes and coordinate conversions of one camera's images.

    Attributes:
        margin: cells added on every side, so that boxes may extend beyond the image.
        visible: `(h, w)` of the working image, 0 where it is ignored.
        weight: `(H, W)` in cells with margin, 1 where the image is visible.
    """

    def __init__(
        self,
        size: tuple[int, int],
        work_width: int,
        cell_pixels: int,
        outside: float,
        ignore: Sequence[Polygon],
    ) -> None:
        height, width = size
        self._size = size
        scale = min(1.0, work_width / width)
        self._work = (max(round(height * scale), cell_pixels), max(round(width * scale), cell_pixels))
        self._cell_pixels = cell_pixels
        self.margin = round(outside * self._work[0] / cell_pixels)
        self._not_ignored = visible_mask(*self._work, ignore, scale)
        self.hide(np.empty((0, 4)))

    def hide(self, covered: npt.NDArray[np.float64]) -> None:
        """Ignore rectangles `(K, 4)` of the image, too, instead of those before."""
        self.visible = self._not_ignored.copy()
        for left, top, right, bottom in np.rint(covered * self.work_scale).astype(int).tolist():
            self.visible[top:bottom, left:right] = 0
        self.weight: Plane = (self.cell_shares(self.visible) > 0.5).astype(np.float32)  # noqa: PLR2004 — half

    def resize(self, image: Image) -> Image:
        """Return the image at the working size, `(h, w, 3)`."""
        return scale_image(image, self.work_size)

    def cell_shares(self, mask: Mask) -> Plane:
        """Return the share of the mask in each cell, 0 to 1, padded by the margin."""
        size = (self._work[1] // self._cell_pixels, self._work[0] // self._cell_pixels)
        shares = cv2.resize(mask, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255.0
        return np.pad(shares, self.margin)

    def cells_to_work(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Convert boxes from cells to pixels of the working image, clipped to it."""
        height, width = self._work
        limits = np.array([width, height, width, height], dtype=np.float64)
        return np.asarray(np.clip((boxes - self.margin) * self._pixels_per_cell, 0.0, limits))

    def work_to_cells(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Convert boxes from pixels of the working image to cells."""
        return np.asarray(boxes / self._pixels_per_cell + self.margin)

    @property
    def bounds(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The first and last `(x, y)` of the image, in cells."""
        size = np.array([self._work[1] // self._cell_pixels, self._work[0] // self._cell_pixels])
        return np.full(2, float(self.margin)), size + float(self.margin)

    @property
    def _pixels_per_cell(self) -> npt.NDArray[np.float64]:
        height, width = self._work
        return np.array([width / (width // self._cell_pixels), height / (height // self._cell_pixels)] * 2)

    @property
    def work_size(self) -> tuple[int, int]:
        """The width and height of the working image, pixels."""
        return self._work[1], self._work[0]

    @property
    def work_height(self) -> int:
        """The height of the working image, pixels."""
        return self._work[0]

    @property
    def work_scale(self) -> float:
        """Size of the working image over that of the camera's image."""
        return self._work[0] / self._size[0]

    def work_to_image(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Convert boxes from pixels of the working image to pixels of the camera's image."""
        return np.asarray(boxes * self._image_pixels)

    def image_to_work(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Convert boxes from pixels of the camera's image to pixels of the working image."""
        return np.asarray(boxes / self._image_pixels)

    @property
    def _image_pixels(self) -> npt.NDArray[np.float64]:
        return np.array([self._size[1] / self._work[1], self._size[0] / self._work[0]] * 2)
