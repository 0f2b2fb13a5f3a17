"""A floor divided into areas, so that several services can each take the cameras and people of one.

The floor is cut in two where both sides have their share of the cameras' views, and each side again (a k-d
tree: Bentley, 1975). Every place is in exactly one area, also outside of all views.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.geometry.ground_plane import from_ground, pixel_steps, to_ground

Floats = NDArray[np.float64]

_GRID = 16
"""Foot points per row and column of a picture."""
_MAX_DISTANCE = 8.0
"""How many times smaller than at the lower edge people may be in a picture: farther away nobody is found."""
_MIN_SHARE = 0.1
"""Share of the floor in a picture that another camera sees, from which on they see the same, in pixels."""


class FloorAreas:
    """A floor in `count` areas, from 0.

    Args:
        homographies: by camera, image pixels -> ground plane; None: not calibrated.
        sizes: width and height of each camera's pictures, pixels.
        count: of areas; at most as many as there are calibrated cameras.

    Raises:
        ValueError: there are more areas than calibrated cameras that see floor, or these see the same.
    """

    def __init__(
        self,
        homographies: Mapping[str, Floats | None],
        sizes: Mapping[str, tuple[int, int]],
        count: int,
    ) -> None:
        self._views = {
            camera: view
            for camera, matrix in homographies.items()
            if matrix is not None and len((view := _FloorView.of(matrix, sizes[camera])).places)
        }
        self._others = [camera for camera in homographies if camera not in self._views]
        if count > 1 and len(self._views) < count:
            raise ValueError(
                f"{count} areas need as many calibrated cameras at least, but there are {len(self._views)}"
            )
        centers = np.array([view.places.mean(axis=0) for view in self._views.values()]).reshape(-1, 2)
        everywhere = np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
        self._bounds = np.stack(_divide(centers, everywhere, count))
        self._own = dict(zip(self._views, self.area_of(centers).tolist(), strict=True))
        """The area of each view's center."""
        if set(self._own.values()) != set(range(count)):
            raise ValueError(f"the cameras' views are too alike to divide the floor into {count} areas")

    def area_of(self, places: Floats) -> NDArray[np.int64]:
        """Return the area of each of (K, 2) places, (K,); -1: the place is not known (NaN)."""
        lower, upper = self._bounds[:, :1], self._bounds[:, 1:]
        inside = ((places >= lower) & (places < upper)).all(axis=2)
        return np.where(inside.any(axis=0), inside.argmax(axis=0), -1)

    def floor_of(self, area: int) -> tuple[float, float, float, float]:
        """Return least x and y, largest x and y of an area; outer ones are far beyond all views."""
        seen = np.concatenate([view.places for view in self._views.values()])
        extent = np.ptp(seen, axis=0)
        lower, upper = self._bounds[area]
        least = np.maximum(lower, seen.min(axis=0) - extent)
        largest = np.minimum(upper, seen.max(axis=0) + extent)
        return (*least.tolist(), *largest.tolist())

    def cameras_of(self, area: int) -> tuple[str, ...]:
        """Return the cameras whose view has its center in an area, sorted.

        Those without a homography are of area 0.
        """
        own = [camera for camera, of in self._own.items() if of == area]
        return tuple(sorted([*own, *(self._others if area == 0 else ())]))

    def also_seen_by(self, area: int) -> tuple[str, ...]:
        """Return the cameras of other areas that see the same floor as one of an area, sorted."""
        own = set(self.cameras_of(area))
        other = {camera: view.places for camera, view in self._views.items() if camera not in own}
        seeing = [
            camera
            for camera, places in other.items()
            if any(
                max(
                    self._views[one].sees(places).mean(),
                    self._views[camera].sees(self._views[one].places).mean(),
                )
                >= _MIN_SHARE
                for one in own & self._views.keys()
            )
        ]
        return tuple(sorted(seeing))


@dataclass(frozen=True, slots=True, eq=False)
class _FloorView:
    """The floor in a picture, as far as people are large enough there to be found."""

    homography: Floats
    size: tuple[int, int]
    places: Floats
    """(K, 2) all over it, evenly in the picture."""

    @classmethod
    def of(cls, homography: Floats, size: tuple[int, int]) -> _FloorView:
        """Return the view of a camera."""
        columns, rows = np.meshgrid(*((np.arange(_GRID) + 0.5) / _GRID for _ in range(2)))
        points = np.stack([columns.ravel() * size[0], rows.ravel() * size[1]], axis=1)
        places = to_ground(homography, points[_is_close(homography, size, points)])
        return cls(homography, size, places)

    def sees(self, places: Floats) -> NDArray[np.bool_]:
        """Return which of (K, 2) places are in it, (K,)."""
        points = from_ground(self.homography, places)
        with np.errstate(invalid="ignore"):
            inside = ((points >= 0) & (points < np.array(self.size))).all(axis=1)
        found = np.zeros(len(places), dtype=np.bool_)
        found[inside] = _is_close(self.homography, self.size, points[inside])
        return found


def _is_close(homography: Floats, size: tuple[int, int], points: Floats) -> NDArray[np.bool_]:
    """Return at which image points (K, 2) the floor is, and not too far."""
    width, height = size
    near = _sideways(homography, np.array([[width / 2.0, float(height)]]))[0]
    with np.errstate(invalid="ignore"):
        return np.asarray(_sideways(homography, points) < _MAX_DISTANCE * near)


def _sideways(homography: Floats, points: Floats) -> Floats:
    """Return how long a pixel to the right is on the ground at image points (K, 2), (K,); NaN: no floor."""
    return np.asarray(np.hypot(*pixel_steps(homography, points)[..., 0].T))


def _divide(centers: Floats, bounds: Floats, count: int) -> list[Floats]:
    """Divide a rectangle of the floor, (2, 2) lower and upper corner, into `count` of them.

    `centers` (C, 2): of the views of the cameras there.
    """
    if count <= 1:
        return [bounds]
    axis = int(np.ptp(centers, axis=0).argmax())
    ordered = centers[np.argsort(centers[:, axis], kind="stable")]
    fewer = count // 2
    below = round(len(centers) * fewer / count)
    below = min(max(below, fewer), len(centers) - (count - fewer))
    at = ordered[below - 1 : below + 1, axis].mean()
    lower, upper = bounds.copy(), bounds.copy()
    lower[1, axis] = upper[0, axis] = at
    return [*_divide(ordered[:below], lower, fewer), *_divide(ordered[below:], upper, count - fewer)]
