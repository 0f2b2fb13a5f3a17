"""By how much each camera errs about where people stand, learned from how well cameras agree.

Noise differs from detection to detection. An offset stays: calibrations err, and detectors put feet too high
or too low. Offsets mix people up: where two stand side by side, the boxes of one in one camera and of the
other in the other camera can be nearer to each other than those of the same person.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats
from tracking.ground_plane.gaussians import squared_distances
from tracking.ground_plane.places.hypotheses import Places

_MEMORY = 400.0
"""Detections that a camera's errors are learned from."""
_PRIOR = 40.0
"""Detections that what is assumed before anything is learned counts for."""
_PRIOR_FACTOR = 3.0
"""Factor of the assumed noise before anything is learned. Wide: a noise that is too small makes two people of
one, and who is two can never show by how much the cameras disagree."""
_MAX_DISTANCE = 9.2
"""Squared distances count for at most this, the quantile .99, so that a wrong group does no harm."""
_RANGE = (1.0, 5.0)
"""Factors of the assumed noise between which it is learned: too small a noise loses people."""
_MAX_OFFSET_M = 1.0
"""Meters of the longest offset: cameras that disagree by more are not calibrated."""


class PlaceErrors:
    """The errors of each camera's places.

    Attributes:
        noise: (C,) factors of the standard deviations that are assumed for feet and calibration.
        offsets: (C, 2) meters by which places are wrong on average. What all cameras have in common does not
            show, and is left.
    """

    def __init__(self, cameras: int) -> None:
        self.noise: Floats = np.full(cameras, _PRIOR_FACTOR)
        self.offsets: Floats = np.zeros((cameras, 2))
        self._sums = np.tile(_PRIOR * np.array([_PRIOR_FACTOR**2, 1.0]), (cameras, 1))
        self._counts = np.full(cameras, _PRIOR)

    def update(self, places: Places, chosen: Sequence[int]) -> None:
        """Learn from the chosen places of a final frame that more than one camera sees.

        The places are without the offsets known so far.
        """
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
            for n, camera in enumerate(measurements.camera[group]):
                self._sums[camera] *= 1.0 - 1.0 / _MEMORY
                self._sums[camera] += (
                    min(distances[n], _MAX_DISTANCE) * self.noise[camera] ** 2,
                    expected[n],
                )
                if distances[n] < _MAX_DISTANCE:
                    self._counts[camera] = min(self._counts[camera] + 1.0, _MEMORY)
                    self.offsets[camera] += offsets[n] / self._counts[camera]
        self.noise = np.clip(np.sqrt(self._sums[:, 0] / self._sums[:, 1]), *_RANGE)
        lengths = np.linalg.norm(self.offsets, axis=1, keepdims=True)
        self.offsets *= _MAX_OFFSET_M / np.maximum(lengths, _MAX_OFFSET_M)
