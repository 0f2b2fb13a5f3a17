"""How each camera saw everybody last, from one decision to the next."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview import LastSeen, SeenViews

Ints = NDArray[np.int64]


def _nothing() -> LastSeen:
    return LastSeen(np.zeros((0, 0)), np.zeros((0, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class Lately:
    """What was seen before a pulse.

    Attributes:
        pulse: before which.
        numbers: (K,) of whom, rising.
        last: by camera and person.
    """

    pulse: int = 0
    numbers: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    last: LastSeen = field(default_factory=_nothing)

    def of(self, numbers: Ints, cameras: int, pulse: int) -> LastSeen:
        """Give what was seen of these people, (K,) rising, before a pulse; who is new has not been seen."""
        ago, worth = np.full((cameras, len(numbers)), np.inf), np.zeros((cameras, len(numbers)))
        _, old, new = np.intersect1d(self.numbers, numbers, assume_unique=True, return_indices=True)
        if old.size:
            ago[:, new] = self.last.ago[:, old] + (pulse - self.pulse)
            worth[:, new] = self.last.worth[:, old]
        return LastSeen(ago, worth)

    @staticmethod
    def after(numbers: Ints, last: LastSeen, views: SeenViews, first: int, pulse: int) -> Lately:
        """Give the same before a later pulse, by the views from `first` on."""
        return Lately(pulse, numbers, last.later(views, pulse - first))
