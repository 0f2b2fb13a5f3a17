"""Cameras that should see a person and do not: evidence for shadows and ghosts of the background."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bestview.association.tracklet_clusters import TrackletCluster
from bestview.geometry.ground_plane import person_heights, to_ground

Floats = NDArray[np.float64]

_SIDE_MARGIN, _BOTTOM_MARGIN = 0.25, 0.1
"""How far feet must be inside the picture's sides, and above its lower edge, in heights of the person."""
_MIN_APPARENT_HEIGHT = 0.15
"""Least apparent height at which a person is detected reliably, as a share of the picture's height."""


class GhostCheck:
    """Counts the calibrated cameras that miss a person in full view.

    Args:
        homographies: by camera name, image pixels -> common ground plane; None: not calibrated.
    """

    def __init__(self, homographies: Mapping[str, Floats | None]) -> None:
        known = {camera: homography for camera, homography in homographies.items() if homography is not None}
        self._cameras = tuple(known)
        self._homographies = np.array(list(known.values())).reshape(-1, 3, 3)

    def count_missing_cameras(
        self, cluster: TrackletCluster, picture_sizes: Mapping[str, tuple[int, int]], height: float
    ) -> int:
        """Count the cameras that should see a cluster at its last known position and never have.

        Args:
            cluster: tracklets of one person; the last localized endpoint is its position.
            picture_sizes: width and height in pixels of the cameras that have reported.
            height: of a person in ground units; NaN: not known yet, the count is 0.
        """
        missing = [
            camera in picture_sizes and camera not in cluster.cameras_so_far for camera in self._cameras
        ]
        localized = [
            tracklet.end for tracklet in cluster.tracklets if not np.isnan(tracklet.end.ground_point).any()
        ]
        if not any(missing) or not localized or not height > 0:
            return 0
        ground_point = max(localized, key=lambda endpoint: endpoint.frame).ground_point
        sizes = np.array([picture_sizes.get(camera, (0, 0)) for camera in self._cameras], dtype=np.float64)
        return int((in_full_view(self._homographies, sizes, ground_point, height) & missing).sum())


def in_full_view(homographies: Floats, sizes: Floats, place: Floats, height: float) -> NDArray[np.bool_]:
    """Return which of C cameras show a person at a place completely and large enough to be detected.

    Furniture and other people are not considered.

    Args:
        homographies: (C, 3, 3) image -> ground.
        sizes: (C, 2) width and height of the pictures, pixels.
        place: (2,) ground units.
        height: of a person, ground units.

    Returns:
        (C,) bool.
    """
    # Sums of products in a fixed order, as in `to_ground`.
    x, y, w = np.moveaxis((np.linalg.inv(homographies) * np.append(place, 1.0)).sum(axis=-1), -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        feet = np.stack([x / w, y / w], axis=-1)
        one_pixel_tall = np.concatenate([feet - (0.0, 1.0), feet], axis=-1)
        tall = height / person_heights(homographies, one_pixel_tall)
        wide, high = sizes.T
        inside = (np.minimum(feet[:, 0], wide - feet[:, 0]) > _SIDE_MARGIN * tall) & (
            tall > _MIN_APPARENT_HEIGHT * high
        )
        inside &= (feet[:, 1] > tall) & (feet[:, 1] < high - _BOTTOM_MARGIN * tall)
    # A point behind a camera is projected above its horizon.
    return np.asarray(inside & ~np.isnan(to_ground(homographies, feet)).any(axis=-1))
