"""Pinhole camera over the floor, in person heights: the model that is fitted to a walk.

The floor is z = 0 and people are 1 tall. The eight parameters are as general as a homography, but each has a
meaning and a prior.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, sin

import numpy as np

from bestview.calibration.homography import Floats

PARAMETERS = 8
FOCAL, ASPECT, TILT, ROLL, CAMERA_HEIGHT, PAN, EAST, NORTH = range(PARAMETERS)
"""Indices of the parameters: log of the focal length in picture widths, log of how much taller than
wide a pixel's picture is, angles of the optical axis below the horizon and about itself, log of the height
above the floor, direction on the floor, and position there (person heights, radians)."""

VIEW = slice(0, PAN)
POSE = slice(PAN, PARAMETERS)


_MAX_DEPTH = 1000.0
"""Person heights beyond which a point is too near the horizon to have a position."""
_MIN_DEPTH = 1e-3


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A camera.

    Attributes:
        parameters: (8,), in the order of `FOCAL` to `NORTH`.
        size: width and height of the picture, pixels.
    """

    parameters: Floats
    size: tuple[int, int]

    def floor_homography(self, person_height: float = 1.0) -> Floats:
        """Return the homography from pixels to the floor, (3, 3); people are `person_height` units tall."""
        back = np.diag([person_height, person_height, 1.0]) @ self._inverse()
        return np.asarray(back / np.abs(back).max())

    def floor(self, feet: Floats) -> Floats:
        """Map foot points to the floor: (..., 2) pixels -> (..., 2) person heights; NaN above the horizon."""
        back = self._inverse()
        through = feet @ back[:, :2].T + back[:, 2]
        return np.asarray(through[..., :2] / _valid_depth(through[..., 2:]))

    def floor_and_steps(self, feet: Floats) -> tuple[Floats, Floats]:
        """Map foot points to the floor, with the derivatives by the pixel's column and row.

        (..., 2) pixels -> (..., 2) and (..., 2, 2) person heights. The last axis of the derivatives is the
        direction in the picture, the one before it east and north.
        """
        back = self._inverse()
        through = feet @ back[:, :2].T + back[:, 2]
        near = _valid_depth(through[..., 2:])
        place = through[..., :2] / near
        steps = (back[:2, :2] - place[..., None] * back[2, :2]) / near[..., None]
        return place, steps

    def picture(self, place: Floats) -> Floats:
        """Map floor positions to the picture: (..., 2) person heights -> (..., 2) pixels; NaN behind it."""
        through = place @ self._projection()[:, :2].T + self._projection()[:, 3]
        depth = np.where(through[..., 2:] > _MIN_DEPTH, through[..., 2:], np.nan)
        return np.asarray(through[..., :2] / depth)

    def heights(self, feet: Floats) -> Floats:
        """Return how tall people appear at foot points: (..., 2) pixels -> (...) pixels; NaN: no floor."""
        place = self.floor(feet)
        head = np.concatenate(
            [place, np.ones((*place.shape[:-1], 1)), np.ones((*place.shape[:-1], 1))], axis=-1
        )
        through = head @ self._projection().T
        depth = np.where(through[..., 2] > _MIN_DEPTH, through[..., 2], np.nan)
        return np.asarray(feet[..., 1] - through[..., 1] / depth)

    def _inverse(self) -> Floats:
        """Return the (3, 3) matrix from pixels to the floor; its last row gives one over the depth."""
        return np.asarray(np.linalg.inv(self._projection()[:, [0, 1, 3]]))

    def _focal(self) -> tuple[float, float]:
        focal = exp(self.parameters[FOCAL]) * self.size[0]
        return focal, focal * exp(self.parameters[ASPECT])

    def _axes(self) -> Floats:
        """Return right, down and forward, (3, 3) rows."""
        tilt, roll, pan = self.parameters[[TILT, ROLL, PAN]].tolist()
        cos_pan, sin_pan, cos_tilt, sin_tilt = cos(pan), sin(pan), cos(tilt), sin(tilt)
        level = (sin_pan, -cos_pan, 0.0)
        below = (-cos_pan * sin_tilt, -sin_pan * sin_tilt, -cos_tilt)
        right = [cos(roll) * a + sin(roll) * b for a, b in zip(level, below, strict=True)]
        down = [cos(roll) * b - sin(roll) * a for a, b in zip(level, below, strict=True)]
        return np.array([right, down, [cos_pan * cos_tilt, sin_pan * cos_tilt, -sin_tilt]])

    def _projection(self) -> Floats:
        """Return the (3, 4) projection from the world to pixels."""
        axes, (focal_x, focal_y) = self._axes(), self._focal()
        east, north, high = self.parameters[[EAST, NORTH, CAMERA_HEIGHT]].tolist()
        shift = -axes @ np.array([east, north, exp(high)])
        width, height = self.size
        lens = np.array([[focal_x, 0, width / 2], [0, focal_y, height / 2], [0, 0, 1]])
        return np.asarray(lens @ np.column_stack([axes, shift]))


def _valid_depth(near: Floats) -> Floats:
    """Set points without depth or with too much of it to NaN; `near` is one over the depth."""
    return np.where(near > 1.0 / _MAX_DEPTH, near, np.nan)
