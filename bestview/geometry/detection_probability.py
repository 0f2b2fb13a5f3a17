"""Detection probability by image position, learned from people whom other cameras see there."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_ROWS, _COLUMNS = 18, 32
"""Cells of a picture, for feet: a cell is about as wide as somebody who is not near."""
_AROUND = 3
"""Cells that are averaged in each direction: places are known no better."""
_GOOD = 0.5
"""Detection rate of a camera below which its places are not compared with it."""
_HIDDEN, _MORE = 0.04, 0.02
"""The share of looks in which people are really hidden, and misses beyond it by which a camera is known."""


class DetectionProbabilityMap:
    """Estimates how likely each camera detects a person who stands at a place.

    The probability at a place is ``(found + w camera) / (trials + w)`` over the cells around it, with `w` the
    `cell_prior_weight`, and the camera's ``(found + v prior) / (trials + v)`` over all of its picture, with
    `v` the `camera_prior_weight`.

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
        self._size, self._prior, self._few, self._many = size, prior, cell_prior_weight, camera_prior_weight
        self._counts = np.zeros((2, cameras, _ROWS, _COLUMNS))
        """Looks, and those in which somebody was found."""
        self._own = np.full(cameras, prior)
        self._shares = np.full((cameras, _ROWS, _COLUMNS), prior)

    def learn(self, camera: Ints, feet: Floats, found: Mask, looks: Floats | float, kept: float) -> None:
        """Count trials: people who stand in a camera's view, and whether it detected them.

        Args:
            camera: (V,) camera of each trial.
            feet: (V, 2) position in its picture, pixels.
            found: (V,).
            looks: weight of each trial, (V,) or of all of them.
            kept: factor on all earlier counts.
        """
        cells = self._cells(camera, feet)
        self._counts *= kept
        flat = self._counts.reshape(2, -1)
        weights = np.broadcast_to(np.asarray(looks, dtype=np.float64), cells.shape)
        flat[0] += np.bincount(cells, weights, flat.shape[1])
        flat[1] += np.bincount(cells[found], weights[found], flat.shape[1])
        looked, seen = self._counts.sum(axis=(2, 3))
        self._own = (seen + self._many * self._prior) / (looked + self._many)
        around = (
            scipy.ndimage.uniform_filter(self._counts, (1, 1, _AROUND, _AROUND), mode="constant") * _AROUND**2
        )
        self._shares = (around[1] + self._few * self._own[:, None, None]) / (around[0] + self._few)

    def probability(self, camera: Ints, feet: Floats) -> Floats:
        """Return the probability that cameras (V,) detect people at (V, 2) pixels of their pictures."""
        return self._shares.reshape(-1)[self._cells(camera, feet)]

    def trust(self, camera: Ints, feet: Floats) -> Floats:
        """Return how surely cameras (V,) show undetected people at (V, 2) pixels: (V,) in [0, 1].

        ``min(p / max(own, 0.5), 1) · min(max((1 - own - 0.04) / 0.02, 0), 1)``, with `p` the probability
        there and `own` that of the whole camera. If a camera detects nearly everybody, whom it does not
        detect is occluded.
        """
        place = np.minimum(self.probability(camera, feet) / np.maximum(self._own, _GOOD)[camera], 1.0)
        misses = np.clip((1.0 - self._own - _HIDDEN) / _MORE, 0.0, 1.0)
        return np.asarray(place * misses[camera])

    def _cells(self, camera: Ints, feet: Floats) -> Ints:
        """Return the cells of positions, (V,); those outside the picture are clipped to its edge."""
        width, height = self._size
        column = np.clip(feet[..., 0] * (_COLUMNS / width), 0, _COLUMNS - 1).astype(np.int64)
        row = np.clip(feet[..., 1] * (_ROWS / height), 0, _ROWS - 1).astype(np.int64)
        return np.asarray((camera * _ROWS + row) * _COLUMNS + column)
