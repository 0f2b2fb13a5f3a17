"""How briskly people move, learned from where they went: halls are walked through, courts are sprinted over.

The speeds and accelerations that `GroundSettings` assumes are those of people who walk. On a court people are
then lost in every sprint; assumed everywhere, those of a court would join people who walk past each other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tracking.boxes import Floats
from tracking.ground_plane.motion import MotionState, reach_costs
from tracking.ground_plane.settings import GroundSettings

_FACTORS = np.geomspace(1.0, 4.0, 5)
"""Of speed and acceleration; 4: professional players."""
_MEMORY = 3000.0
"""Moves that the factor is learned from: a minute of six people."""
_MAX_COST = 12.0
"""A move costs at most this, so that people who are mixed up do no harm."""
_PRIOR = 6.0
"""Log likelihood ratio by which another factor must be better than 1."""
_PENALTIES = np.where(_FACTORS > 1.0, _PRIOR, 0.0)


class MotionScale:
    """The factor of speed and acceleration under which the moves of people are the most likely.

    Attributes:
        settings: the assumed ones, with speed and acceleration multiplied by the factor.
    """

    def __init__(self, assumed: GroundSettings) -> None:
        self.settings = assumed
        self._candidates = [
            replace(assumed, speed=factor * assumed.speed, acceleration=factor * assumed.acceleration)
            for factor in _FACTORS
        ]
        self._costs: Floats = np.zeros(len(_FACTORS))

    def update(self, state: MotionState, seconds: float, place: Floats, covariance: Floats) -> None:
        """Learn from a person, last in `state`, who was found at a place (2,) after so many seconds."""
        costs = [
            float(reach_costs(state, seconds, place[None], covariance[None], settings)[0])
            for settings in self._candidates
        ]
        self._costs += np.minimum(costs, _MAX_COST) - self._costs / _MEMORY
        self.settings = self._candidates[int(np.argmin(self._costs + _PENALTIES))]
