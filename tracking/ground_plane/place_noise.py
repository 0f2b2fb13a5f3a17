"""The noise of the places of each camera, learned from how well cameras agree about where people stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats
from tracking.ground_plane.gaussians import squared_distances
from tracking.ground_plane.hypotheses import Places

_MEMORY = 400.0
"""Detections that a camera's noise is learned from."""
_PRIOR = 40.0
"""Detections that the assumed noise counts for."""
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
        self.factors: Floats = np.ones(cameras)
        self._sums = np.full((cameras, 2), _PRIOR)

    def update(self, places: Places, chosen: Sequence[int]) -> None:
        """Learn from the chosen places of a final frame that more than one camera sees."""
        for k in chosen:
            group = list(places.groups[k])
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
