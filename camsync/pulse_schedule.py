"""The time axis: which pulse is due when."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PulseSchedule:
    """Pulse n is due at ``epoch + n / fps``: computed from n, so that no error adds up.

    ``epoch`` is when pulse 0 was due (unix seconds on one clock), ``fps`` the pulses per second.
    """

    epoch: float
    fps: float

    @classmethod
    def through(cls, number: int, due: float, fps: float) -> PulseSchedule:
        """Return the axis on which pulse ``number`` is due at ``due``."""
        return cls(due - number / fps, fps)

    def due(self, number: int) -> float:
        """Return when pulse ``number`` is due."""
        return self.epoch + number / self.fps

    def number_at(self, time: float) -> int:
        """Return the last pulse due at or before ``time``: negative before the epoch."""
        number = math.floor((time - self.epoch) * self.fps)
        # The product rounds otherwise than the quotient of due() does: agree with due() exactly.
        while self.due(number) > time:
            number -= 1
        while self.due(number + 1) <= time:
            number += 1
        return number
