"""A floor divided into areas, so that several services can each take the cameras and people of one.

The floor is cut in two where both sides have their share of the cameras' views, and each side again (a k-d
tree: Bentley, 1975). Every place is in exactly one area, also outside of all views.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bestview.geometry.floor_view import FloorView

Floats = NDArray[np.float64]


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
            if matrix is not None and len((view := FloorView.of(matrix, sizes[camera])).places)
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
        seeing = [
            camera
            for camera, view in self._views.items()
            if camera not in own and any(view.overlaps(self._views[one]) for one in own & self._views.keys())
        ]
        return tuple(sorted(seeing))


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
