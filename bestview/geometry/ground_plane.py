"""Ground plane: foot points through homographies, person heights, horizon."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import ArrayLike, NDArray

_EDGE = 0.01
"""Share of the picture's height, on both sides of its lower edge, in which feet count as cut off."""
_HEIGHT_OF_SPAN = 2.2
"""How much taller people are than their box from above is wide: 1.7 m over shoulders, arms and steps."""
_MAX_CONDITION = 1e12
"""Condition number above which a 3x3 matrix, scaled by rows and columns, counts as singular."""


def validate_homography(matrix: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return a homography (image pixels -> ground plane) as a (3, 3) float64 array.

    Args:
        matrix: anything that NumPy converts to an array.
        name: of the camera, for the message.

    Raises:
        ValueError: not 3x3, not finite numbers, or not invertible. The message is one line with `name`.
    """
    try:
        homography = np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"the homography of {name} is not a 3x3 matrix of numbers") from None
    if homography.shape != (3, 3):
        raise ValueError(f"the homography of {name} has shape {homography.shape}, not (3, 3)")
    if not np.isfinite(homography).all():
        raise ValueError(f"the homography of {name} has entries that are not finite numbers")
    # Image coordinates are hundreds and the last row is thousandths: equilibrate before the condition number.
    rows = np.abs(homography).max(axis=1, keepdims=True)
    evened = homography / np.where(rows > 0, rows, 1.0)
    columns = np.abs(evened).max(axis=0, keepdims=True)
    evened = evened / np.where(columns > 0, columns, 1.0)
    if not np.linalg.cond(evened) < _MAX_CONDITION:
        raise ValueError(f"the homography of {name} is not invertible")
    return homography


def foot_points(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the foot point of each box, the middle of its lower edge: (..., 4) -> (..., 2) in pixels."""
    return np.stack([(boxes[..., 0] + boxes[..., 2]) / 2.0, boxes[..., 3]], axis=-1)


def upright_from_overhead(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert boxes of people seen from straight above to boxes of people who stand upright there: (..., 4).

    A person seen from above stands in the middle of the box, not on its lower edge, and shows shoulders and
    steps instead of height. The box returned has its foot point in the middle and is as tall as the person.
    """
    left, top, right, bottom = np.moveaxis(boxes, -1, 0)
    foot = (top + bottom) / 2.0
    # A badly predicted box may be inside out: its person has height 0.
    height = _HEIGHT_OF_SPAN * np.sqrt(np.maximum((right - left) * (bottom - top), 0.0))
    return np.stack([left, foot - height, right, foot], axis=-1)


def to_ground(homography: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map image points to the ground plane: (..., 2) pixels -> (..., 2) ground units.

    A point on or above the horizon has no ground point and becomes NaN, as does a NaN point. The ground is
    assumed below the horizon in the picture (a camera that is not upside down). Here and below, the
    homography is one for all, (3, 3), or has leading axes that broadcast: (..., 3, 3).
    """
    mapped = _homogeneous(homography, points)
    depth = _depth(homography, mapped)
    return np.asarray(mapped[..., :2] / np.where(depth > 0, mapped[..., 2], np.nan)[..., None])


def from_ground(homography: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map ground points to the picture: (..., 2) ground units -> (..., 2) pixels.

    A point behind the camera, and a NaN, becomes NaN.
    """
    mapped = _homogeneous(np.asarray(np.linalg.inv(homography), dtype=np.float64), points)
    pixels = mapped[..., :2] / np.where(mapped[..., 2] != 0, mapped[..., 2], np.nan)[..., None]
    # Points behind the camera are projected above the horizon.
    in_front = _depth(homography, _homogeneous(homography, pixels)) > 0
    return np.where(in_front[..., None], pixels, np.nan)


def horizon_row(homography: NDArray[np.float64], x: float) -> float | None:
    """Return the row of the horizon in the picture's column `x`, in pixels; None: it has none."""
    down = float(homography[2, 1])
    row = -(float(homography[2, 0]) * x + float(homography[2, 2])) / down if down else np.inf
    return row if np.isfinite(row) else None


def shows_ground(homography: NDArray[np.float64], size: tuple[int, int]) -> bool:
    """Return whether any of a picture (width, height) lies below the horizon, and so can show the ground.

    No part does if the camera is tilted beyond straight down, or is mounted upside down.
    """
    width, height = size
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
    return bool((_depth(homography, _homogeneous(homography, corners)) > 0).any())


def ground_handedness(homography: NDArray[np.float64]) -> int:
    """Return whether the ground's axes have the same handedness as the picture's: 1, or -1 if mirrored.

    It is the same in every picture of a floor that is seen from above (Hartley and Zisserman, 2.4.1: the sign
    of a homography's Jacobian is that of its determinant over the third coordinate cubed).
    """
    third = homography[2]
    sign = next((float(np.sign(entry)) for entry in (third[1], third[2], third[0]) if entry), 0.0)
    return int(np.sign(np.linalg.det(homography)) * sign)


def camera_height(homography: NDArray[np.float64], x: float) -> float | None:
    """Estimate the height of the camera above the ground, in ground units; None: unknown. `x` is any column.

    At a foot point as many rows below the horizon as a person is tall in the picture, the person is as tall
    as the camera is high (square pixels, little roll).
    """
    row = horizon_row(homography, x)
    if row is None:
        return None
    height = float(person_heights(homography, np.array([x, row, x, row + 100.0])))
    return height if np.isfinite(height) else None


def feet_cut_off(
    boxes: NDArray[np.float64], picture_height: float | NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return which boxes' feet the picture's lower edge cuts off: (..., 4), heights that broadcast -> (...).

    They have no ground point. A box that reaches beyond the edge was extrapolated and counts as complete.
    """
    return np.asarray(np.abs(boxes[..., 3] / picture_height - 1.0) < _EDGE)


def person_heights(homography: NDArray[np.float64], boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the height of the person in each box in ground units: (..., 4) -> (...), NaN where unknown.

    At the foot point one pixel sideways is as long as one pixel upwards on a standing person (square pixels,
    a camera without much roll or tilt): box height times ground units per sideways pixel.
    """
    sideways = pixel_steps(homography, foot_points(boxes))[..., 0]
    return np.asarray(np.hypot(sideways[..., 0], sideways[..., 1]) * (boxes[..., 3] - boxes[..., 1]))


def foot_covariance(
    homography: NDArray[np.float64], boxes: NDArray[np.float64], sideways: float, upwards: float
) -> NDArray[np.float64]:
    """Compute the covariance of each foot point on the ground: (..., 4) -> (..., 2, 2) ground units squared.

    Boxes are accurate to within `sideways` and `upwards` (standard deviations, shares of their height). On
    the ground the latter is long and along the line of sight: distance is least certain.
    """
    height = boxes[..., 3] - boxes[..., 1]
    axes = (
        pixel_steps(homography, foot_points(boxes)) * height[..., None, None] * np.array([sideways, upwards])
    )
    x, y = axes[..., 0, :], axes[..., 1, :]
    xx, xy, yy = (x * x).sum(axis=-1), (x * y).sum(axis=-1), (y * y).sum(axis=-1)
    return np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-2)


def pixel_steps(homography: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ground vectors of one pixel to the right and one down, as columns: (..., 2) -> (..., 2, 2)."""
    mapped = _homogeneous(homography, points)
    w = np.where(_depth(homography, mapped) > 0, mapped[..., 2], np.nan)[..., None, None]
    # d(X/w) = (dX w - X dw) / w^2, both pixel axes at once.
    across = homography[..., :2, :2] * w - mapped[..., :2, None] * homography[..., 2:, :2]
    return np.asarray(across / w**2)


def _homogeneous(homography: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    # Sums of products in a fixed order: a BLAS may sum differently by batch size, and with it the result.
    x, y = points[..., 0:1], points[..., 1:2]
    return np.asarray(homography[..., 0] * x + homography[..., 1] * y + homography[..., 2])


def _depth(homography: NDArray[np.float64], mapped: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the homogeneous third coordinate, signed so that it is positive below the horizon."""
    # Far down the picture the y term determines the sign; a view from above (no y term) has no horizon.
    down = homography[..., 2, 1]
    sign = np.where(down != 0, np.sign(down), np.sign(mapped[..., 2]))
    return np.asarray(mapped[..., 2] * sign)


class PersonHeightEstimate:
    """Running estimate of a person's height in units of the ground plane."""

    _HISTORY_LENGTH = 200

    def __init__(self) -> None:
        self._medians: deque[float] = deque(maxlen=self._HISTORY_LENGTH)

    def learn(self, heights: NDArray[np.float64]) -> None:
        """Add estimated heights of any shape, NaN where unknown."""
        known = heights[np.isfinite(heights) & (heights > 0)]
        if known.size:
            self._medians.append(float(np.median(known)))

    @property
    def height(self) -> float:
        """Median of the updates' medians, in ground units; NaN before the first one."""
        return float(np.median(np.array(self._medians))) if self._medians else float("nan")
