"""A pinhole camera over a ground plane."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]

_PLUMB = 0.999  # vertical part of a unit direction from which a camera counts as looking straight down


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A camera's position and target, in meters; the world's z axis points up."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    field_of_view: float = 72.0  # horizontal, degrees


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """A pinhole camera: projects world points (meters) to image points (pixels).

    Image coordinates are continuous: pixel ``(i, j)`` covers ``[i, i + 1) x [j, j + 1)``.
    """

    center: Floats  # (3,) optical center, meters
    axes: Floats  # (3, 3) rows: right, down, forward
    focal: float  # pixels
    width: int  # pixels
    height: int  # pixels

    @classmethod
    def at(cls, view: Viewpoint, width: int, height: int) -> PinholeCamera:
        """Build a camera with a level horizon at a viewpoint; looking straight down, north is at the top."""
        center = np.array(view.position, dtype=np.float64)
        forward = np.array(view.target, dtype=np.float64) - center
        forward /= np.linalg.norm(forward)
        plumb = abs(forward[2]) > _PLUMB
        right = np.cross(forward, (0.0, 1.0, 0.0) if plumb else (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(forward, right), forward])
        focal = 0.5 * width / math.tan(math.radians(view.field_of_view) / 2)
        return cls(center, axes, focal, width, height)

    @property
    def looks_straight_down(self) -> bool:
        """Whether it looks straight down."""
        return bool(self.axes[2, 2] < -_PLUMB)

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Project ``(N, 3)`` world points to ``(N, 2)`` pixels and their ``(N,)`` depths in meters.

        A point at or behind the camera is projected as if it were 5 cm in front of it.
        """
        local = (points - self.center) @ self.axes.T
        depth = local[:, 2]
        scale = self.focal / np.maximum(depth, 0.05)
        pixels = local[:, :2] * scale[:, None]
        pixels += (self.width / 2, self.height / 2)
        return pixels, depth

    def ray_grid(self, columns: Floats, rows: Floats) -> Floats:
        """Return the unit directions ``(R, C, 3)`` of the rays through ``columns x rows``."""
        across = (columns - self.width / 2) / self.focal
        down = (rows - self.height / 2) / self.focal
        right, below, forward = self.axes
        directions = forward + across[None, :, None] * right + down[:, None, None] * below
        unit: Floats = directions / np.linalg.norm(directions, axis=2, keepdims=True)
        return unit

    def homography(self) -> Floats:
        """Return the homography ``(3, 3)`` from image points to the floor (meters); the last entry is 1."""
        intrinsic = np.array(
            [[self.focal, 0, self.width / 2], [0, self.focal, self.height / 2], [0, 0, 1]], dtype=np.float64
        )
        shift = -self.axes @ self.center
        to_image = intrinsic @ np.column_stack([self.axes[:, 0], self.axes[:, 1], shift])
        inverse = np.linalg.inv(to_image)
        normalized: Floats = inverse / inverse[2, 2]
        return normalized
