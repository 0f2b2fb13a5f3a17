"""The noise of the places of each camera, learned from how well cameras agree about where people stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats
from tracking.ground_plane.gaussians import squared_distances
from tracking.ground_plane.places.hypotheses import Places

_MEMORY = 400.0
"""Detections that a camera's noise is learned from."""
_PRIOR = 40.0
"""Detections that the noise before anything is learned counts for."""
_PRIOR_FACTOR = 3.0
"""Factor of the assumed noise before anything is learned. Wide: a noise that is too small makes two people of
one, and who is two can never show by how much the cameras disagree."""
_MAX_DISTANCE = 9.2
"""Squared distances count for at most this, the quantile .99, so that a wrong group does no harm."""
_RANGE = (1.0, 5.0)
"""Factors of the assumed noise between which it is learned: too small a noise loses people."""


class PlaceNoise:
    """Factors of the standard deviations that are assumed for the feet and the calibration of each camera.

    Attributes:
        factors: (C,) of each camera.
    """

    def __init__(self, cameras: int) -> None:
        self.factors: Floats = np.full(cameras, _PRIOR_FACTOR)
        self._sums = np.tile(_PRIOR * np.array([_PRIOR_FACTOR**2, 1.0]), (cameras, 1))

    def update(self, places: Places, chosen: Sequence[int]) -> None:
        """Learn from the chosen places of a final frame that more than one camera sees."""
        for k in chosen:
            group = places.locating(k)
            if len(group) == 1:
                continue
            measurements = places.measurements
            offsets = measurements.places[group] - places.means[k]
            spread = measurements.covariances[group]
            # The place is the mean of the group: its offsets vary less than the measurements.
            distances = squared_distances(offsets, spread)
            expected = 2.0 - np.einsum("nij,ji->n", np.linalg.inv(spread), places.covariances[k])
            for camera, distance, freedom in zip(
                measurements.camera[group], distances, expected, strict=True
            ):
                self._sums[camera] *= 1.0 - 1.0 / _MEMORY
                self._sums[camera] += min(distance, _MAX_DISTANCE) * self.factors[camera] ** 2, freedom
        self.factors = np.clip(np.sqrt(self._sums[:, 0] / self._sums[:, 1]), *_RANGE)
