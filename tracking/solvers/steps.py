"""Steps uphill along slopes that jump about: each number by steps of its own size, as Adam takes them."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats

_MEMORY, _MEMORY_OF_SIZE = 0.6, 0.9
"""Shares of the former direction, and of the former typical size of a slope, in the next one."""

_STILL = 1e-3
"""Slopes far below this are no reason to move."""


class Steps:
    """Remembers slopes; numbers may join at the end of the first axis."""

    def __init__(self) -> None:
        self._way = self._size = np.empty(0)
        self._weight = self._weight_of_size = 0.0

    def along(self, slope: Floats) -> Floats:
        """Give the next step, about 1 where the slopes agree with each other and near 0 where not."""
        if len(self._way) < len(slope):
            joined = np.zeros((len(slope) - len(self._way), *slope.shape[1:]))
            self._way = np.concatenate([self._way.reshape(-1, *slope.shape[1:]), joined])
            self._size = np.concatenate([self._size.reshape(-1, *slope.shape[1:]), joined])
        self._way = _MEMORY * self._way + (1.0 - _MEMORY) * slope
        self._size = _MEMORY_OF_SIZE * self._size + (1.0 - _MEMORY_OF_SIZE) * slope**2
        self._weight = _MEMORY * self._weight + (1.0 - _MEMORY)
        self._weight_of_size = _MEMORY_OF_SIZE * self._weight_of_size + (1.0 - _MEMORY_OF_SIZE)
        typical = np.sqrt(self._size / self._weight_of_size)
        return np.asarray(self._way / self._weight / (typical + _STILL))
