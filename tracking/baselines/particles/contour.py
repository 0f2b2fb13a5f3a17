"""Outlines as closed B-splines, and how well an image's edges agree with them (Isard, Blake, IJCV 1998).

Along M normals of an outline the nearest edge is searched. With n the distance of a normal's edge, which is
at most μ, and r a variance, both in heights of the person, the image has the likelihood

    exp(-Σ over normals of min(n², μ²) / (2 r M))
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.detectors.base import Image

_HALF_BODY = (
    (0.5, -0.04),
    (0.66, 0.02),
    (0.66, 0.14),
    (0.9, 0.2),
    (1.04, 0.34),
    (0.98, 0.55),
    (0.85, 0.75),
    (0.8, 0.95),
    (0.7, 1.0),
)
"""Control points of the right half of a standing person, from head to foot, in shares of the box."""
BODY = np.array([*_HALF_BODY, *((1.0 - x, y) for x, y in _HALF_BODY[:0:-1])])
"""Control points of a standing person's outline, clockwise, `(K, 2)`."""

_EDGE_SHARE = 0.06
"""Share of the pixels with the strongest gradients that may begin an edge."""
_WEAK_EDGE = 0.5
"""Share of that gradient down to which an edge continues."""


def spline_basis(controls: int, samples: int, *, derivative: bool = False) -> Floats:
    """Return `(samples, controls)`: weights of a closed uniform cubic B-spline's control points.

    Samples are equally spaced in the spline's parameter; with `derivative`, for its tangent.
    """
    place = np.arange(samples) * controls / samples
    first = np.floor(place).astype(np.intp)
    t = place - first
    if derivative:
        parts = [-((1 - t) ** 2) / 2, (3 * t**2 - 4 * t) / 2, (-3 * t**2 + 2 * t + 1) / 2, t**2 / 2]
    else:
        parts = [
            (1 - t) ** 3 / 6,
            (3 * t**3 - 6 * t**2 + 4) / 6,
            (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6,
            t**3 / 6,
        ]
    basis = np.zeros((samples, controls))
    for offset, weights in enumerate(parts):
        basis[np.arange(samples), (first + offset - 1) % controls] += weights
    return basis


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Points of an outline and its outward normals.

    Attributes:
        points: `(M, 2)`, in heights, relative to the center of the box.
        normals: `(M, 2)`, unit vectors.
    """

    points: Floats
    normals: Floats

    @staticmethod
    def of_body(aspect: float, samples: int) -> Outline:
        """Return the outline of a standing person in a box of this width over height."""
        controls = (BODY - 0.5) * np.array([aspect, 1.0])
        return Outline.of_controls(controls, samples)

    @staticmethod
    def of_controls(controls: Floats, samples: int) -> Outline:
        """Return the outline of control points `(K, 2)`, in heights, clockwise in the image."""
        tangents = spline_basis(len(controls), samples, derivative=True) @ controls
        lengths = np.maximum(np.hypot(*tangents.T), 1e-9)[:, None]
        normals = np.stack([tangents[:, 1], -tangents[:, 0]], axis=1) / lengths
        return Outline(spline_basis(len(controls), samples) @ controls, normals)

    def fitted(self, offsets: Floats, controls: int) -> Outline:
        """Return the outline of the spline nearest to the points, moved by `(M,)` along the normals."""
        moved = self.points + offsets[:, None] * self.normals
        basis = spline_basis(controls, len(moved))
        found, *_ = np.linalg.lstsq(basis, moved, rcond=None)
        return Outline.of_controls(np.asarray(found, dtype=np.float64), len(moved))


def find_edges(image: Image) -> NDArray[np.bool_]:
    """Return the edges of an image, `(H, W)`: Canny with thresholds from the image's own gradients."""
    gray = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), (0, 0), 1.0)
    across, down = (cv2.Sobel(gray, cv2.CV_16S, x, 1 - x) for x in (1, 0))
    strength = np.abs(across.astype(np.int32)) + np.abs(down)
    strong = max(float(np.quantile(strength, 1.0 - _EDGE_SHARE)), 1.0)
    return np.asarray(cv2.Canny(across, down, _WEAK_EDGE * strong, strong) > 0)


def edge_distances(
    edges: NDArray[np.bool_], outline: Outline, centers: Floats, heights: Floats, reach: float, steps: int
) -> Floats:
    """Return the signed distance of the edge nearest to each point of outlines, along its normal.

    Args:
        edges: `(H, W)`.
        outline: the outline of all of them.
        centers: `(P, 2)`, pixels.
        heights: `(P,)`, pixels.
        reach: search at most that far on either side, in heights.
        steps: positions searched on either side.

    Returns:
        `(P, M)`, in heights, positive outwards; infinite where there is none.
    """
    # From the outline outwards, so that the first one found is the nearest.
    sides = np.arange(1, steps + 1) * reach / steps
    offsets = np.concatenate([[0.0], np.stack([sides, -sides], axis=1).ravel()])
    lines = outline.points[:, None] + offsets[:, None] * outline.normals[:, None]
    places = centers[:, None, None] + heights[:, None, None, None] * lines
    column, row = np.moveaxis(np.floor(places).astype(np.intp), -1, 0)
    height, width = edges.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    found = edges[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)] & inside
    return np.where(found.any(axis=-1), offsets[found.argmax(axis=-1)], np.inf)


def contour_cost(distances: Floats, reach: float) -> Floats:
    """Return the mean over normals of min(n², μ²) / μ², in [0, 1]; n `(..., M)`, and μ the reach."""
    return np.asarray((np.minimum(np.abs(distances), reach) ** 2).mean(axis=-1) / reach**2)
