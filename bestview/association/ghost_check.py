"""Which cameras should see somebody, and do not: what speaks against shadows and ghosts of the background."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bestview.association.tracklet_groups import Group
from bestview.geometry.ground_plane import person_heights, to_ground

Floats = NDArray[np.float64]

_ASIDE, _BELOW = 0.25, 0.1
"""How far feet must be inside the picture's sides, and above its lower edge, in heights of the person."""
_LEAST_TALL = 0.15
"""Least height of who is seen for sure, as a share of the picture's."""


class Doubt:
    """Knows what ground each camera sees.

    Args:
        homographies: by camera name, image pixels -> common ground plane; None: not calibrated.
    """

    def __init__(self, homographies: Mapping[str, Floats | None]) -> None:
        known = {camera: it for camera, it in homographies.items() if it is not None}
        self._cameras = tuple(known)
        self._homographies = np.array(list(known.values())).reshape(-1, 3, 3)

    def silent(self, group: Group, pictures: Mapping[str, tuple[int, int]], height: float) -> int:
        """Count the cameras that should see a group where it was last, and have no part in it.

        Args:
            group: who is asked about; its last place that is known counts.
            pictures: width and height in pixels of the cameras that can be asked.
            height: of a person in ground units; NaN: not known yet, and nobody can be said to be missed.
        """
        asked = [camera in pictures and camera not in group.cameras for camera in self._cameras]
        ends = [it.end for it in group.episodes if not np.isnan(it.end.ground).any()]
        if not any(asked) or not ends or not height > 0:
            return 0
        place = max(ends, key=lambda it: it.frame).ground
        sizes = np.array([pictures.get(camera, (0, 0)) for camera in self._cameras], dtype=np.float64)
        return int((in_full_view(self._homographies, sizes, place, height) & asked).sum())


def in_full_view(homographies: Floats, sizes: Floats, place: Floats, height: float) -> NDArray[np.bool_]:
    """Say which of C cameras show a person at a place whole, and large enough to be found.

    Furniture and other people may still be in front.

    Args:
        homographies: (C, 3, 3) picture -> ground.
        sizes: (C, 2) width and height of the pictures, pixels.
        place: (2,) ground units.
        height: of a person, ground units.
    """
    # Sums of products in a fixed order, as in `to_ground`.
    x, y, w = np.moveaxis((np.linalg.inv(homographies) * np.append(place, 1.0)).sum(axis=-1), -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        feet = np.stack([x / w, y / w], axis=-1)
        one_pixel_tall = np.concatenate([feet - (0.0, 1.0), feet], axis=-1)
        tall = height / person_heights(homographies, one_pixel_tall)
        wide, high = sizes.T
        inside = (np.minimum(feet[:, 0], wide - feet[:, 0]) > _ASIDE * tall) & (tall > _LEAST_TALL * high)
        inside &= (feet[:, 1] > tall) & (feet[:, 1] < high - _BELOW * tall)
    # Who is behind a camera would be above its horizon.
    return np.asarray(inside & ~np.isnan(to_ground(homographies, feet)).any(axis=-1))
