"""Points under homographies."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats


def homogeneous(points: Floats) -> Floats:
    """Return points (K, 2) with a third coordinate of 1, (K, 3)."""
    return np.concatenate([points, np.ones((len(points), 1))], axis=1)


def map_points(matrix: Floats, points: Floats) -> Floats:
    """Map points (K, 2) by a homography (3, 3), (K, 2).

    NaN: behind the camera, which is where the third coordinate is not positive.
    """
    mapped = homogeneous(points) @ matrix.T
    return np.asarray(mapped[:, :2] / np.where(mapped[:, 2:] > 0.0, mapped[:, 2:], np.nan))
