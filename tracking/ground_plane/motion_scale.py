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
_NONE_MISPLACED = np.zeros((2, 2))
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

    def move_costs(self, states: MotionState, seconds: Floats, places: Floats, covariances: Floats) -> Floats:
        """Return the costs (P, F) of moves under each factor, for `learn`.

        P people, last in `states`, were found at `places` (P, 2) after so many `seconds` (P,).
        """
        found = [
            reach_costs(states, seconds, places[:, None], covariances[:, None], _NONE_MISPLACED, settings)[
                :, 0
            ]
            for settings in self._candidates
        ]
        return np.minimum(np.stack(found, axis=1), _MAX_COST)

    def learn(self, costs: Floats) -> None:
        """Learn from one person's move, with costs (F,)."""
        self._costs += costs - self._costs / _MEMORY
        self.settings = self._candidates[int(np.argmin(self._costs + _PENALTIES))]
