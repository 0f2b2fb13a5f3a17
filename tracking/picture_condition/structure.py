"""The structure of a picture: gradients at a coarse scale, and how much fine detail there is.

It is measured on a gray picture of at most `_SIDE` pixels a side, in cells of a sixteenth of that.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats
from tracking.detectors.base import Image, Plane
from tracking.image_scaling import scale_image

_SIDE = 320
_CELLS = 16
PART_CELLS = 32
"""Cells along the longer side of a picture by which a part of it is described."""

Cells = npt.NDArray[np.bool_]
"""`(R, C)`."""


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """The structure of one picture.

    Attributes:
        gray: `(h, w)` the picture that is measured, gray levels.
        across: `(h / 2, w / 2)` change of the gray level from column to column.
        down: the same from row to row.
        fine: `(h, w)` what a slight blur takes away.
        edges: `(R, C)` mean squared gradient of each cell.
        detail: `(R, C)` mean squared fine detail of each cell.
    """

    gray: Plane
    across: Plane
    down: Plane
    fine: Plane
    edges: Floats
    detail: Floats

    def agreement(self, other: Structure) -> Floats:
        """Return the correlation of both pictures' gradients in each cell, `(R, C)`, -1 to 1.

        It depends neither on brightness nor on contrast.
        """
        product = cell_means(self.across * other.across + self.down * other.down, self.edges.shape)
        return np.asarray(product / np.sqrt(np.maximum(self.edges * other.edges, _LEAST_PRODUCT)))

    def noise(self, other: Structure) -> float:
        """Return the mean squared gradient that is noise, from another picture of the same scene.

        Noise is independent from pixel to pixel; light and motion change gradients more than fine detail.
        """
        across, down = self.across - other.across, self.down - other.down
        grid = self.edges.shape
        gradient = float(np.median(cell_means(across * across + down * down, grid))) / 2.0
        fine = float(np.median(cell_means((self.fine - other.fine) ** 2, grid))) / 2.0
        return min(gradient, fine / FINE_NOISE)


_LEAST_PRODUCT = 1e-6
# Squared fine detail of white noise over its squared coarse gradient.
FINE_NOISE = 8.0


def structure_of(gray: Plane) -> Structure:
    """Return the structure of a gray picture `(h, w)`, as `reduce` returns it."""
    coarse = cv2.pyrDown(gray)
    across = np.asarray(cv2.Sobel(coarse, cv2.CV_32F, 1, 0, scale=0.125), dtype=np.float32)
    down = np.asarray(cv2.Sobel(coarse, cv2.CV_32F, 0, 1, scale=0.125), dtype=np.float32)
    fine = gray - cv2.GaussianBlur(gray, (5, 5), 1.0)
    grid = grid_of(gray.shape, _CELLS)
    edges, detail = cell_means(across * across + down * down, grid), cell_means(fine * fine, grid)
    return Structure(gray, across, down, fine, edges, detail)


def reduce(image: Image) -> Plane:
    """Return an image `(H, W, 3)` gray, at the size that is measured."""
    scale = _SIDE / max(image.shape[:2])
    if scale < 1.0:
        image = scale_image(image, (round(image.shape[1] * scale), round(image.shape[0] * scale)))
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)


def grid_of(shape: tuple[int, ...], cells: int) -> tuple[int, int]:
    """Return rows and columns of nearly square cells in a picture `(h, w)`, `cells` along its longer side.

    A picture of half the size may have another grid: take the gray picture's for all that belongs to it.
    """
    height, width = shape
    cell = max(height, width) / cells
    return max(round(height / cell), 1), max(round(width / cell), 1)


def cell_means(plane: Plane, grid: tuple[int, ...]) -> Floats:
    """Return the mean of each cell of a plane, `(R, C)`, in a `grid` of as many rows and columns."""
    rows, columns = grid
    return np.asarray(cv2.resize(plane, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.float64)
