"""Homographies by least squares (Hartley and Zisserman, Multiple View Geometry, 4.1 to 4.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MIN_POINTS = 4
_STEPS = 20
_CONVERGENCE = 1e-12
_MIN_RANK = 1e-5
"""Eighth singular value, relative to the largest, below which the points determine no homography."""

Floats = NDArray[np.float64]


def fit_homography(source: Floats, target: Floats) -> Floats:
    """Fit the homography that maps source to target points with least squared error in the target plane.

    The direct linear transform on normalized points, refined by Gauss-Newton steps.

    Args:
        source: (N, 2), at least four points.
        target: (N, 2) their images.

    Returns:
        The (3, 3) matrix; its last entry is 1 where that is possible.

    Raises:
        ValueError: the points determine none: too few, or (all but one of) them on a line.
    """
    if len(source) < MIN_POINTS:
        raise ValueError(f"{len(source)} points: a homography needs {MIN_POINTS}")
    to_source, from_target = _normalizer(source), _normalizer(target)
    x, y = _apply(to_source, source), _apply(from_target, target)
    # The left singular vectors are not needed: in full they would be a matrix of (2N)^2 entries.
    _, singular_values, rows = np.linalg.svd(_equations(x, y), full_matrices=False)
    if not singular_values[7] > _MIN_RANK * singular_values[0]:
        raise ValueError("the points, or all but one of them, are on a line")
    homography = _gauss_newton(rows[-1].reshape(3, 3), x, y)
    homography = np.linalg.inv(from_target) @ homography @ to_source
    size = np.abs(homography).max()
    last = homography[2, 2]
    return np.asarray(homography / (last if abs(last) > 1e-9 * size else size))


def apply_homography(homography: Floats, points: Floats) -> Floats:
    """Map points through a homography: (..., 2) -> (..., 2); the horizon is not checked."""
    through = points @ homography[:, :2].T + homography[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(through[..., :2] / through[..., 2:])


def _normalizer(points: Floats) -> Floats:
    """Return the similarity that moves the points around 0 at a mean distance of the square root of 2."""
    middle = points.mean(axis=0)
    mean_distance = float(np.hypot(*(points - middle).T).mean())
    if not mean_distance > 0:
        raise ValueError("all points are at one place")
    scale = np.sqrt(2.0) / mean_distance
    return np.array([[scale, 0, -scale * middle[0]], [0, scale, -scale * middle[1]], [0, 0, 1]])


def _apply(similarity: Floats, points: Floats) -> Floats:
    return np.asarray(points * similarity[0, 0] + similarity[:2, 2])


def _equations(x: Floats, y: Floats) -> Floats:
    """Return two linear equations in the nine entries for each pair, (2 N or 9, 9)."""
    ones = np.column_stack([x, np.ones(len(x))])
    none = np.zeros_like(ones)
    above = np.column_stack([ones, none, -y[:, :1] * ones])
    below = np.column_stack([none, ones, -y[:, 1:] * ones])
    equations = np.concatenate([above, below])
    return np.concatenate([equations, np.zeros((max(0, 9 - len(equations)), 9))])


def _gauss_newton(homography: Floats, x: Floats, y: Floats) -> Floats:
    """Refine by Gauss-Newton steps, as long as they reduce the error."""
    best = homography / np.linalg.norm(homography)
    least = _error(best, x, y)
    for _ in range(_STEPS):
        w = (x @ best[2, :2] + best[2, 2])[:, None]
        if not (np.abs(w) > _CONVERGENCE).all():
            return best
        ones = np.column_stack([x, np.ones(len(x))]) / w
        zeros, image = np.zeros_like(ones), apply_homography(best, x)
        slopes = np.concatenate(
            [
                np.column_stack([ones, zeros, -image[:, :1] * ones]),
                np.column_stack([zeros, ones, -image[:, 1:] * ones]),
            ]
        )
        step = np.linalg.lstsq(slopes, (y - image).T.ravel(), rcond=1e-10)[0]
        candidate = best + step.reshape(3, 3)
        candidate = candidate / np.linalg.norm(candidate)
        error = _error(candidate, x, y)
        if not error < least:
            return best
        converged = least - error <= _CONVERGENCE * least
        best, least = candidate, error
        if converged:
            break
    return best


def _error(homography: Floats, x: Floats, y: Floats) -> float:
    return float(((apply_homography(homography, x) - y) ** 2).sum())
