"""A camera over a ground plane: its homography, and the sizes of people's boxes in its picture."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import BOX_SIDES, Floats, heights, shares_within
from tracking.homographies import homogeneous, map_points

_MIN_BOXES = 30
"""Boxes after which the heights of people in the picture are known."""
_ASPECTS_KEPT = 500
_BOTTOM = 0.95
"""A part of the picture, from above, that is certainly below the horizon."""


@dataclass(frozen=True, eq=False)
class GroundCamera:
    """A camera's calibration.

    Attributes:
        homography: (3, 3), from image points in pixels to the ground plane.
        width: of the picture, pixels.
        height: of the picture, pixels.
        turned: (3, 3) from image points to where the picture shows them since the camera was turned; None:
            it was not.
        covered: (K, 4) rectangles of image points, beside each other, in which people are hidden: the lens is
            covered, leaves move.

    Raises:
        ValueError: the homography is not invertible, or not a matrix (3, 3) of finite numbers.
    """

    homography: Floats
    width: float
    height: float
    turned: Floats | None = None
    covered: Floats = field(default_factory=lambda: np.empty((0, BOX_SIDES)))

    def __post_init__(self) -> None:
        if self.homography.shape != (3, 3) or not np.isfinite(self.homography).all():
            raise ValueError("a homography is a matrix (3, 3) of finite numbers")
        if np.linalg.matrix_rank(self.homography) < len(self.homography):
            raise ValueError("the homography is not invertible")

    def scaled(self, units_per_meter: float) -> GroundCamera:
        """Return the camera with a homography to meters."""
        scale = np.diag([1.0, 1.0, units_per_meter])
        return replace(self, homography=scale @ self.homography)

    def shifted(self, offset: Floats) -> GroundCamera:
        """Return the camera with all places moved by an offset (2,)."""
        move = np.eye(3)
        move[:2, 2] = offset
        return replace(self, homography=move @ self.homography)

    def to_ground(self, points: Floats) -> Floats:
        """Map image points (K, 2) to the ground plane, (K, 2)."""
        mapped = homogeneous(points) @ self.homography.T
        return np.asarray(mapped[:, :2] / mapped[:, 2:])

    def to_image(self, places: Floats) -> Floats:
        """Map places (K, 2) to image points, (K, 2); NaN behind the camera."""
        return map_points(self._inverse, places)

    @cached_property
    def _inverse(self) -> Floats:
        """The homography to the image, whose third coordinate is positive in front of the camera."""
        inverse = np.linalg.inv(self.homography)
        bottom = self.to_ground(np.array([[self.width / 2.0, _BOTTOM * self.height]]))
        return np.asarray(inverse * np.sign((homogeneous(bottom) @ inverse.T)[0, 2]))

    def jacobians(self, points: Floats) -> Floats:
        """Return the derivatives of `to_ground` at image points (K, 2), (K, 2, 2)."""
        mapped = homogeneous(points) @ self.homography.T
        ground = mapped[:, :2] / mapped[:, 2:]
        numerators = self.homography[:2, :2] - ground[:, :, None] * self.homography[2, :2]
        return np.asarray(numerators / mapped[:, 2, None, None])

    def shown(self, points: Floats) -> Floats:
        """Return where the picture shows image points (K, 2) since the camera was turned; NaN: nowhere."""
        return points if self.turned is None else map_points(self.turned, points)

    def covered_shares(self, boxes: Floats) -> Floats:
        """Return the share of each box (K, 4) that is hidden, (K,); 0 of NaN."""
        if not len(self.covered):
            return np.zeros(len(boxes))
        return np.asarray(np.nan_to_num(shares_within(boxes, self.covered)).sum(axis=1))

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """Return which image points (K, 2) are in the picture; NaN is not."""
        points = self.shown(points)
        return np.asarray(
            (points[:, 0] >= 0.0)
            & (points[:, 0] < self.width)
            & (points[:, 1] >= 0.0)
            & (points[:, 1] < self.height)
        )


class BoxSizes:
    """Heights and widths of people's boxes by the place of their feet, learned from all boxes of a camera.

    On a plane the height of an upright person is linear in the image point of the feet.
    """

    def __init__(self) -> None:
        self._information = 1e-9 * np.eye(3)
        self._projections = np.zeros(3)
        self._aspects: deque[float] = deque(maxlen=_ASPECTS_KEPT)
        self._boxes = 0
        self._slopes: Floats = np.zeros(3)
        self._aspect = 0.0

    @property
    def known(self) -> bool:
        """Whether enough boxes were seen."""
        return self._boxes >= _MIN_BOXES

    def update(self, boxes: Floats) -> None:
        """Add boxes (K, 4)."""
        if not len(boxes):
            return
        tall = np.maximum(heights(boxes), 1.0)
        rows, weights = _scaled(feet(boxes)), 1.0 / tall**2
        self._information += (rows * weights[:, None]).T @ rows
        self._projections += (rows * weights[:, None]).T @ tall
        self._aspects.extend((boxes[:, 2] - boxes[:, 0]) / tall)
        self._boxes += len(boxes)
        self._slopes = np.asarray(np.linalg.solve(self._information, self._projections), dtype=np.float64)
        self._aspect = float(np.median(self._aspects))

    def boxes(self, points: Floats) -> Floats:
        """Return the boxes of people whose feet are at image points (K, 2), (K, 4); NaN: too small."""
        tall = np.asarray(_scaled(points) @ self._slopes)
        tall[tall <= 1.0] = np.nan
        half = tall * self._aspect / 2.0
        return np.stack([points[:, 0] - half, points[:, 1] - tall, points[:, 0] + half, points[:, 1]], axis=1)


def feet(boxes: Floats) -> Floats:
    """Return the middles of the lower edges of boxes (K, 4), (K, 2)."""
    return np.stack([(boxes[:, 0] + boxes[:, 2]) / 2.0, boxes[:, 3]], axis=1)


def _scaled(points: Floats) -> Floats:
    return np.concatenate([points / 1000.0, np.ones((len(points), 1))], axis=1)
