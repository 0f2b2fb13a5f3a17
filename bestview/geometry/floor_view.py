"""The floor that a camera shows, and which cameras show the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bestview.geometry.ground_plane import from_ground, pixel_steps, to_ground

Floats = NDArray[np.float64]

_GRID = 24
"""Foot points per row and column of a picture."""
_MAX_DISTANCE = 8.0
"""How many times smaller than at the lower edge people may be in a picture: farther away nobody is found."""
_MIN_SHARE = 0.1
"""Share of the floor in a picture that another camera shows, from which on the two overlap."""


@dataclass(frozen=True, slots=True, eq=False)
class FloorView:
    """The floor in a picture, as far as people are large enough there to be found.

    Attributes:
        homography: (3, 3) image pixels -> ground plane.
        size: width and height of the picture, pixels.
        places: (K, 2) all over the floor, evenly in the picture.
    """

    homography: Floats
    size: tuple[float, float]
    places: Floats

    @classmethod
    def of(cls, homography: Floats, size: tuple[float, float]) -> FloorView:
        """Return the view of a camera."""
        columns, rows = np.meshgrid(*((np.arange(_GRID) + 0.5) / _GRID for _ in range(2)))
        points = np.stack([columns.ravel() * size[0], rows.ravel() * size[1]], axis=1)
        return cls(homography, size, to_ground(homography, points[_is_close(homography, size, points)]))

    def sees(self, places: Floats) -> NDArray[np.bool_]:
        """Return which of (K, 2) places are in it, (K,)."""
        points = from_ground(self.homography, places)
        with np.errstate(invalid="ignore"):
            inside = ((points >= 0) & (points < np.array(self.size))).all(axis=1)
        found = np.zeros(len(places), dtype=np.bool_)
        found[inside] = _is_close(self.homography, self.size, points[inside])
        return found

    def overlaps(self, other: FloorView) -> bool:
        """Return whether the two show together a part of the floor that either shows."""
        return any(
            len(view.places) > 0 and bool(seeing.sees(view.places).mean() >= _MIN_SHARE)
            for view, seeing in ((self, other), (other, self))
        )


def overlapping_cameras(views: Mapping[str, FloorView]) -> frozenset[str]:
    """Return the cameras whose view overlaps that of another one.

    One camera alone sees people better in its picture, where it knows how its detector errs: tracking them
    jointly with cameras that look elsewhere adds nothing.
    """
    pairs = combinations(views.items(), 2)
    return frozenset(
        camera for (one, first), (other, second) in pairs if first.overlaps(second) for camera in (one, other)
    )


def _is_close(homography: Floats, size: tuple[float, float], points: Floats) -> NDArray[np.bool_]:
    """Return at which image points (K, 2) the floor is, and not too far."""
    width, height = size
    near = _pixel_lengths(homography, np.array([[width / 2.0, height]]))[0]
    with np.errstate(invalid="ignore"):
        return np.asarray(_pixel_lengths(homography, points) < _MAX_DISTANCE * near)


def _pixel_lengths(homography: Floats, points: Floats) -> Floats:
    """Return how long a pixel to the right is on the ground at image points (K, 2), (K,); NaN: no floor."""
    return np.asarray(np.hypot(*pixel_steps(homography, points)[..., 0].T))
