"""Where in its picture a camera finds people, learned from those whom other cameras see there."""

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
"""Cells that are read together, each way: places are known no better."""
_GOOD = 0.5
"""The share that is asked of a camera: one that finds fewer is not taken for a measure of its places."""
_HIDDEN, _MORE = 0.04, 0.02
"""The share of looks in which people are really hidden, and misses beyond it by which a camera is known."""


class DetectionProbabilityMap:
    """Counts in which share of the looks each camera finds somebody who is known to stand at a place.

    A place's share is ``(found + few own) / (looks + few)`` over the cells around it, and the camera's *own*
    ``(found + many prior) / (looks + many)`` over all of its picture: what is not known of a place is taken
    from the camera, and of the camera from the prior.

    Args:
        cameras: C.
        size: width and height of the pictures, pixels.
        prior: the share where nothing is known.
        few: looks at a place after which it speaks for itself.
        many: the same of a camera.
    """

    def __init__(
        self, cameras: int, size: tuple[float, float], prior: float, few: float, many: float
    ) -> None:
        self._size, self._prior, self._few, self._many = size, prior, few, many
        self._counts = np.zeros((2, cameras, _ROWS, _COLUMNS))
        """Looks, and those in which somebody was found."""
        self._own = np.full(cameras, prior)
        self._shares = np.full((cameras, _ROWS, _COLUMNS), prior)

    def learn(self, camera: Ints, feet: Floats, found: Mask, looks: Floats | float, kept: float) -> None:
        """Take in whom cameras were to find, and whether they did.

        Args:
            camera: (V,) whose look each is.
            feet: (V, 2) where in its picture, pixels.
            found: (V,).
            looks: that each of them stands for, (V,) or all of them.
            kept: the share of what was known that is not forgotten by now.
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
        """Give in which share of the looks cameras (V,) find people at (V, 2) pixels of their pictures."""
        return self._shares.reshape(-1)[self._cells(camera, feet)]

    def trust(self, camera: Ints, feet: Floats) -> Floats:
        """Say how surely cameras (V,) show who stands at (V, 2) pixels and is not found: (V,) in [0, 1].

        ``min(share / max(own, 0.5), 1) · min(max((1 - own - 0.04) / 0.02, 0), 1)``: by what the camera finds
        there of what it finds elsewhere, and whether it misses anybody at all. Whom a camera does not find
        that finds nearly everybody is hidden.
        """
        place = np.minimum(self.probability(camera, feet) / np.maximum(self._own, _GOOD)[camera], 1.0)
        misses = np.clip((1.0 - self._own - _HIDDEN) / _MORE, 0.0, 1.0)
        return np.asarray(place * misses[camera])

    def _cells(self, camera: Ints, feet: Floats) -> Ints:
        """Give the cells of places, (V,); those outside the picture count as at its edge."""
        width, height = self._size
        column = np.clip(feet[..., 0] * (_COLUMNS / width), 0, _COLUMNS - 1).astype(np.int64)
        row = np.clip(feet[..., 1] * (_ROWS / height), 0, _ROWS - 1).astype(np.int64)
        return np.asarray((camera * _ROWS + row) * _COLUMNS + column)
