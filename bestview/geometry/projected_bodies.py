"""Projection of people into cameras that do not detect them, from their positions in other cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.geometry.ground_plane import (
    feet_cut_off,
    foot_covariance,
    foot_points,
    from_ground,
    person_heights,
    to_ground,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_SIDEWAYS, _UPWARDS = 0.05, 0.15
"""Standard deviations of foot points in box heights, by which the cameras that see a person are weighted."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyEstimates:
    """Position and size of people at M moments, each one person in one frame.

    Attributes:
        ground_point: (M, 2) ground units; NaN: unknown.
        height: (M,) in ground units, likewise.
        aspect_ratio: (M,) width of the box over its height, likewise.
        known_by: (M, C) whether that camera localized the person.
    """

    ground_point: Floats
    height: Floats
    aspect_ratio: Floats
    known_by: Mask


def estimate_bodies(
    boxes: Floats, camera: Ints, moment: Ints, moments: int, homographies: Floats, bottom: Floats
) -> BodyEstimates:
    """Estimate bodies from boxes: means over the cameras, weighted by precision of the foot point.

    The weight is 1 over the trace of the foot point's covariance on the ground. Boxes whose feet the lower
    edge cuts off are left out.

    Args:
        boxes: (B, 4) pixels, without hidden ones.
        camera: (B,) of each box.
        moment: (B,) person and frame, as one index.
        moments: M, how many there are.
        homographies: (C, 3, 3) pixels -> ground.
        bottom: (C,) lower edge of each camera's own picture, pixels.
    """
    matrix = homographies[camera]
    position, height = to_ground(matrix, foot_points(boxes)), person_heights(matrix, boxes)
    variance = np.trace(foot_covariance(matrix, boxes, _SIDEWAYS, _UPWARDS), axis1=-2, axis2=-1)
    with np.errstate(divide="ignore", invalid="ignore"):  # a box may have no height: it is left out below
        aspect_ratio = (boxes[:, 2] - boxes[:, 0]) / (boxes[:, 3] - boxes[:, 1])
    measurements = np.column_stack([position, height, aspect_ratio])
    valid = np.isfinite(measurements).all(axis=1) & (measurements[:, 2:] > 0.0).all(axis=1) & (variance > 0.0)
    rows = np.flatnonzero(valid & ~feet_cut_off(boxes, bottom[camera]))
    owner, weight = moment[rows], 1.0 / variance[rows]

    def summed(values: Floats) -> Floats:
        # bincount adds row by row, so no sum depends on the number of other rows.
        return np.bincount(owner, values, moments).astype(np.float64)

    total = summed(weight)
    total[total == 0.0] = np.nan
    mean = [summed(weight * column[rows]) / total for column in measurements.T]
    known_by = np.zeros((moments, len(homographies)), dtype=np.bool_)
    known_by[owner, camera[rows]] = True
    return BodyEstimates(np.stack(mean[:2], axis=1), mean[2], mean[3], known_by)


def project_feet(bodies: BodyEstimates, homographies: Floats) -> Floats:
    """Project foot points into each camera's picture, (M, C, 2) pixels; NaN: behind it, or unknown.

    Args:
        bodies: M of them.
        homographies: (C, 3, 3) pixels -> ground.
    """
    return from_ground(homographies, bodies.ground_point[:, None])


def project_boxes(
    bodies: BodyEstimates, moment: Ints, view_feet: Floats, view_homographies: Floats
) -> Floats:
    """Project one body into each of V views, in which its feet are already known: (V, 4) boxes.

    Args:
        bodies: M of them.
        moment: (V,) index of the body of each view.
        view_feet: (V, 2) its foot point in the view's picture, pixels.
        view_homographies: (V, 3, 3) pixels -> ground, of the view's camera.
    """
    x, y = view_feet[:, 0], view_feet[:, 1]
    pixel = person_heights(view_homographies, np.stack([x, y - 1.0, x, y], axis=1))
    height = bodies.height[moment] / pixel
    half_width = height * bodies.aspect_ratio[moment] / 2.0
    return np.stack([x - half_width, y - height, x + half_width, y], axis=1)
