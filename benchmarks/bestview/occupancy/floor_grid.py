"""The grid of ground positions of people, and the box of a person at each position in each camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestview import person_heights, to_ground
from bestview.geometry.ground_plane import from_ground
from tracking.boxes import Floats
from tracking.detectors.background.height_model import HeightModel

Ints = NDArray[np.int64]
_BEYOND = 0.25
"""Share of the picture's height by which people may stand below it, as in MyView's detector."""
_SAMPLES = 40
"""Points along each side of a picture that are projected to find the ground in view."""


@dataclass(frozen=True, slots=True)
class GridSettings:
    """The grid on the ground. Lengths are in person heights.

    Attributes:
        step: between neighboring places; 0.15 is a quarter of a meter, as in the paper.
        aspect: width of a person over their height in the picture.
        min_visible: share of a person that must be inside some picture and not ignored.
        gate: distance from the border of the visible ground within which people enter and leave.
        max_places: limit of the number of places, enforced by a larger step.
    """

    step: float = 0.15
    aspect: float = 0.34
    min_visible: float = 0.5
    gate: float = 0.3
    max_places: int = 4000


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """A camera's geometry.

    Attributes:
        homography: (3, 3) from its picture, pixels, to the ground.
        size: width and height of its picture.
        height_model: heights of people by foot point, in its pixels.
        weight: (H, W), 1 where its picture counts, in cells of equal size.
    """

    homography: Floats
    size: tuple[int, int]
    height_model: HeightModel
    weight: Floats

    def boxes(self, ground: Floats, aspect: float) -> Floats:
        """Return the boxes (..., 4) in pixels of people at places (..., 2); NaN: out of view."""
        foot = from_ground(self.homography, ground)
        x, y = foot[..., 0], foot[..., 1]
        expected = self.height_model.expected_height(y)
        expected = np.where((expected >= self.height_model.min_height) & (expected > 0.0), expected, np.nan)
        half = aspect * expected / 2.0
        return np.stack([x - half, y - expected, x + half, y], axis=-1)

    def cells(self, boxes: Floats) -> Ints:
        """Return the cells (..., 4) that boxes cover, clipped to the picture; an empty range for no box."""
        rows, columns = self.weight.shape
        scale = np.array([columns / self.size[0], rows / self.size[1]] * 2)
        limits = np.array([columns, rows, columns, rows], dtype=np.float64)
        known = np.clip(np.nan_to_num(boxes * scale, nan=0.0), 0.0, limits)
        return np.asarray(np.rint(known), dtype=np.int64)

    def visible_share(self, boxes: Floats) -> Floats:
        """Return the share (K,) of each box (K, 4) that is in the picture and not ignored."""
        sums = cv2.integral(self.weight, sdepth=cv2.CV_64F)
        left, top, right, bottom = self.cells(boxes).T
        inside = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
        cell = self.size[0] * self.size[1] / self.weight.size
        area = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1]) / cell
        return np.asarray(np.nan_to_num(inside / area, nan=0.0))

    def ground(self) -> Floats:
        """Return points (K, 2) over the ground on which it shows people."""
        width, height = self.size
        x, y = np.meshgrid(np.linspace(0, width, _SAMPLES), np.linspace(0, height * (1 + _BEYOND), _SAMPLES))
        expected = self.height_model.expected_height(y)
        feet = np.stack([x, y], axis=-1)[(expected >= self.height_model.min_height) & (expected > 0.0)]
        places = to_ground(self.homography, feet)
        return np.asarray(places[np.isfinite(places).all(axis=1)])

    def person(self) -> float:
        """Return a person's height in ground units: the median over the picture."""
        width, height = self.size
        x, y = np.meshgrid(np.linspace(0.2, 0.8, 7) * width, np.linspace(0.2, 1.0, 17) * height)
        expected = self.height_model.expected_height(y)
        known = (expected >= self.height_model.min_height) & (expected > 0.0)
        boxes = np.stack([x, y - expected, x, y], axis=-1)[known]
        return float(np.nanmedian(person_heights(self.homography, boxes)))


@dataclass(frozen=True, slots=True, eq=False)
class FloorGrid:
    """The grid.

    Attributes:
        places: (L, 2) ground units.
        moves: (L, 9) each place and those around it; L where there is none.
        gates: (L,) whether people may come and go there.
        rectangles: of each camera, (L, 4) in cells of its picture.
        person: a person's height in ground units.
    """

    places: Floats
    moves: Ints
    gates: NDArray[np.bool_]
    rectangles: tuple[Ints, ...]
    person: float


def build_grid(views: Sequence[CameraView], settings: GridSettings) -> FloorGrid:
    """Build the grid over all ground on which some camera shows people."""
    person = float(np.median([view.person() for view in views]))
    ground_points = np.concatenate([view.ground() for view in views])
    step = settings.step * person
    while True:
        mesh, inside = _mesh(views, ground_points, step, settings)
        if np.count_nonzero(inside) <= settings.max_places:
            break
        step *= 1.1
    number = np.full((inside.shape[0] + 2, inside.shape[1] + 2), np.count_nonzero(inside), dtype=np.int64)
    number[1:-1, 1:-1][inside] = np.arange(np.count_nonzero(inside))
    rows, columns = np.nonzero(np.pad(inside, 1))
    moves = [number[rows + down, columns + right] for down in (-1, 0, 1) for right in (-1, 0, 1)]
    reach = max(round(settings.gate * person / step), 1)
    inner = cv2.erode(np.pad(inside, 1).astype(np.uint8), np.ones((2 * reach + 1,) * 2, dtype=np.uint8))
    places = mesh[inside]
    rectangles = tuple(view.cells(view.boxes(places, settings.aspect)) for view in views)
    return FloorGrid(places, np.stack(moves, axis=1), inner[rows, columns] == 0, rectangles, person)


def _mesh(
    views: Sequence[CameraView], ground_points: Floats, step: float, settings: GridSettings
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the places (R, C, 2) of a grid around the visible ground, and which of them are visible."""
    (left, top), (right, bottom) = ground_points.min(axis=0), ground_points.max(axis=0)
    x, y = np.meshgrid(np.arange(left, right + step, step), np.arange(top, bottom + step, step))
    mesh = np.stack([x, y], axis=-1)
    flat = mesh.reshape(-1, 2)
    visible_share = np.max([view.visible_share(view.boxes(flat, settings.aspect)) for view in views], axis=0)
    return mesh, (visible_share >= settings.min_visible).reshape(x.shape)
