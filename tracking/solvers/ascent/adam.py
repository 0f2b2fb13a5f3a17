"""Adam steps (Kingma, Ba 2015): steps of a length of their own along each variable."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Slopes = NDArray[np.floating[Any]]


class AdamSteps:
    """Steps along slopes; variables may be appended along the first axis.

    `momentum` and `decay` are those of the first and the second moment of the slopes. `epsilon` is added to
    the typical slope: much smaller slopes cause no step.
    """

    def __init__(self, momentum: float, decay: float, epsilon: float) -> None:
        self._momentum, self._decay, self._epsilon = momentum, decay, epsilon
        self._moment: Slopes = np.empty(0)
        self._second_moment: Slopes = np.empty(0)
        self._weight = self._second_weight = 0.0

    def step(self, slope: Slopes) -> Slopes:
        """Return the next step: about 1 where the slopes keep their sign, and near 0 elsewhere."""
        if len(self._moment) < len(slope):
            shape = (len(slope) - len(self._moment), *slope.shape[1:])
            self._moment, self._second_moment = (
                np.concatenate([known.reshape(-1, *slope.shape[1:]), np.zeros(shape)], dtype=slope.dtype)
                for known in (self._moment, self._second_moment)
            )
        self._moment = self._momentum * self._moment + (1.0 - self._momentum) * slope
        self._second_moment = self._decay * self._second_moment + (1.0 - self._decay) * slope**2
        self._weight = self._momentum * self._weight + (1.0 - self._momentum)
        self._second_weight = self._decay * self._second_weight + (1.0 - self._decay)
        typical = np.sqrt(self._second_moment / self._second_weight)
        return np.asarray(self._moment / self._weight / (typical + self._epsilon))
