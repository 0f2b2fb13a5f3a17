"""How long a person is on a ground plane of any unit."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray


class PersonHeightEstimate:
    """Running estimate of a person's height in units of the ground plane."""

    _REMEMBERED = 200

    def __init__(self) -> None:
        self._medians: deque[float] = deque(maxlen=self._REMEMBERED)

    def learn(self, heights: NDArray[np.float64]) -> None:
        """Add estimated heights of any shape, NaN where unknown."""
        known = heights[np.isfinite(heights) & (heights > 0)]
        if known.size:
            self._medians.append(float(np.median(known)))

    @property
    def height(self) -> float:
        """Median of the updates' medians, in ground units; NaN before anybody was seen."""
        return float(np.median(np.array(self._medians))) if self._medians else float("nan")
