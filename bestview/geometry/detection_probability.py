"""Detection probability by image position, learned from people that other cameras see there."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_ROWS, _COLUMNS = 18, 32
"""Cells of a picture, for foot points: about as wide as a person at medium distance."""
_SMOOTHING_CELLS = 3
"""Cells averaged in each direction: the accuracy of foot points."""
_MIN_CAMERA_RATE = 0.5
"""Lower bound of a camera's detection rate, to which the rates of its cells are compared."""
_OCCLUSION_RATE, _OCCLUSION_MARGIN = 0.04, 0.02
"""Miss rate explained by occlusion alone, and the excess over it at which misses count in full."""


class DetectionProbabilityMap:
    """Estimates the probability that a camera detects a person at a place in its picture.

    The probability at a place is ``(detections + w camera) / (trials + w)`` over the cells around it, with
    `w` the `cell_prior_weight` and `camera` the probability over the whole picture, ``(detections + v prior)
    / (trials + v)``, with `v` the `camera_prior_weight`.

    Args:
        cameras: C.
        size: width and height of the pictures, pixels.
        prior: the probability where nothing is known.
        cell_prior_weight: trials at a place after which it outweighs the camera.
        camera_prior_weight: trials of a camera after which it outweighs the prior.
    """

    def __init__(
        self,
        cameras: int,
        size: tuple[float, float],
        prior: float,
        cell_prior_weight: float,
        camera_prior_weight: float,
    ) -> None:
        self._size, self._prior, self._cell_weight, self._camera_weight = (
            size,
            prior,
            cell_prior_weight,
            camera_prior_weight,
        )
        self._counts = np.zeros((2, cameras, _ROWS, _COLUMNS))
        """Trials, and those with a detection."""
        self._camera_rate = np.full(cameras, prior)
        self._cell_rate = np.full((cameras, _ROWS, _COLUMNS), prior)

    def learn(
        self, camera: Ints, feet: Floats, detected: Mask, weight: Floats | float, retention: float
    ) -> None:
        """Count trials: people in a camera's view, and whether it detected them.

        Args:
            camera: (V,) camera of each trial.
            feet: (V, 2) position in its picture, pixels.
            detected: (V,).
            weight: of each trial, (V,) or one for all.
            retention: factor on all earlier counts.
        """
        cells = self._cells(camera, feet)
        self._counts *= retention
        flat = self._counts.reshape(2, -1)
        weights = np.broadcast_to(np.asarray(weight, dtype=np.float64), cells.shape)
        flat[0] += np.bincount(cells, weights, flat.shape[1])
        flat[1] += np.bincount(cells[detected], weights[detected], flat.shape[1])
        trials, detections = self._counts.sum(axis=(2, 3))
        self._camera_rate = (detections + self._camera_weight * self._prior) / (trials + self._camera_weight)
        smoothed = (
            scipy.ndimage.uniform_filter(
                self._counts, (1, 1, _SMOOTHING_CELLS, _SMOOTHING_CELLS), mode="constant"
            )
            * _SMOOTHING_CELLS**2
        )
        self._cell_rate = (smoothed[1] + self._cell_weight * self._camera_rate[:, None, None]) / (
            smoothed[0] + self._cell_weight
        )

    def probability(self, camera: Ints, feet: Floats) -> Floats:
        """Return the probability that cameras (V,) detect people at (V, 2) pixels of their pictures."""
        return self._cell_rate.reshape(-1)[self._cells(camera, feet)]

    def undetected_view_probability(self, camera: Ints, feet: Floats) -> Floats:
        """Return the probability that cameras (V,) show people whom they miss at (V, 2) pixels: (V,), 0 to 1.

        ``min(p / max(c, 0.5), 1) · min(max((1 - c - 0.04) / 0.02, 0), 1)``, with `p` the probability at the
        place and `c` that of the whole camera. A camera that detects almost everyone misses only people who
        are occluded.
        """
        relative_rate = np.minimum(
            self.probability(camera, feet) / np.maximum(self._camera_rate, _MIN_CAMERA_RATE)[camera], 1.0
        )
        misses = np.clip((1.0 - self._camera_rate - _OCCLUSION_RATE) / _OCCLUSION_MARGIN, 0.0, 1.0)
        return np.asarray(relative_rate * misses[camera])

    def _cells(self, camera: Ints, feet: Floats) -> Ints:
        """Return the cells of positions, (V,); those outside the picture are clipped to its edge."""
        width, height = self._size
        column = np.clip(feet[..., 0] * (_COLUMNS / width), 0, _COLUMNS - 1).astype(np.int64)
        row = np.clip(feet[..., 1] * (_ROWS / height), 0, _ROWS - 1).astype(np.int64)
        return np.asarray((camera * _ROWS + row) * _COLUMNS + column)
