"""Where sighted people are: in areas of the floor and of pictures, as configured and calibrated today."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import estimate_bodies, foot_points
from bestview.geometry.ground_plane import upright_from_overhead
from server.media.letterbox import Letterbox
from server.rules import Area
from server.service.past_search.sightings import Sightings

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CameraPlacement:
    """Where a camera's picture lies, as it is configured and calibrated today.

    Attributes:
        name: its id.
        letterbox: of its picture in the site's; None: it has not sent any since the service started.
        ground: (3, 3) homography from the site's picture to the floor; None: unknown.
        is_overhead: whether it looks straight down.
    """

    name: str
    letterbox: Letterbox | None = None
    ground: Floats | None = None
    is_overhead: bool = False


class SightedPlaces:
    """Places of S sightings in areas. A place on the floor is the mean over the cameras that see the feet."""

    def __init__(self, sightings: Sightings, cameras: Sequence[CameraPlacement]) -> None:
        self._cameras = cameras
        overhead = np.array([camera.is_overhead for camera in cameras], dtype=np.bool_)[sightings.cameras]
        boxes = sightings.boxes.copy()
        boxes[overhead] = upright_from_overhead(boxes[overhead])
        self._sightings = Sightings(sightings.pulses, sightings.numbers, sightings.cameras, boxes)
        self._floor: tuple[Sightings, Floats] | None = None

    def inside(self, area: Area) -> Sightings:
        """Return the sightings inside an area; on the floor those of all cameras that place them there."""
        if area.camera is None:
            if self._floor is None:
                self._floor = self._floor_points()
            sightings, points = self._floor
        else:
            sightings, points = self._picture_points(area.camera)
        return sightings.of(np.asarray(area.contains(points), dtype=np.bool_))

    def _picture_points(self, name: str) -> tuple[Sightings, Floats]:
        index = next(place for place, camera in enumerate(self._cameras) if camera.name == name)
        letterbox = self._cameras[index].letterbox
        if letterbox is None:
            return self._sightings.of(np.zeros(len(self._sightings), dtype=np.bool_)), np.empty((0, 2))
        own = self._sightings.of(np.equal(self._sightings.cameras, index))
        return own, letterbox.site_to_camera(foot_points(own.boxes))

    def _floor_points(self) -> tuple[Sightings, Floats]:
        """Return the sightings by calibrated cameras whose person's place is known, and that: (B, 2)."""
        calibrated = [
            (index, camera.ground, camera.letterbox)
            for index, camera in enumerate(self._cameras)
            if camera.ground is not None and camera.letterbox is not None
        ]
        indexes = np.array([index for index, _, _ in calibrated], dtype=np.int64)
        seen = self._sightings.of(np.isin(self._sightings.cameras, indexes))
        if not len(seen):
            return seen, np.empty((0, 2))
        keys = np.column_stack([seen.pulses, seen.numbers])
        owners, moment = np.unique(keys, axis=0, return_inverse=True)
        bodies = estimate_bodies(
            seen.boxes,
            np.searchsorted(indexes, seen.cameras),
            moment.reshape(-1),
            len(owners),
            np.array([ground for _, ground, _ in calibrated]),
            np.array([_bottom(letterbox) for _, _, letterbox in calibrated]),
        )
        points = bodies.ground_point[moment.reshape(-1)]
        known = np.asarray(np.isfinite(points).all(axis=1))
        return seen.of(known), points[known]


def _bottom(letterbox: Letterbox) -> float:
    """Return the lower edge of a camera's picture in the site's, pixels."""
    return float(letterbox.camera_to_site(np.array([0.0, letterbox.camera_size[1]]))[1])
