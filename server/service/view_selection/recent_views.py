"""The last views of each person in each camera, kept from one decision to the next."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview import LastDetections, VisibleViews

Ints = NDArray[np.int64]


def _nothing() -> LastDetections:
    return LastDetections(np.zeros((0, 0)), np.zeros((0, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class RecentViews:
    """The last views before a pulse.

    Attributes:
        pulse: the pulse.
        numbers: (K,) the people's numbers, rising.
        last: by camera and person.
    """

    pulse: int = 0
    numbers: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    last: LastDetections = field(default_factory=_nothing)

    def of(self, numbers: Ints, cameras: int, pulse: int) -> LastDetections:
        """Return the last views of these people, (K,) rising, before a pulse; new people have none."""
        age, quality = np.full((cameras, len(numbers)), np.inf), np.zeros((cameras, len(numbers)))
        _, old, new = np.intersect1d(self.numbers, numbers, assume_unique=True, return_indices=True)
        if old.size:
            age[:, new] = self.last.age[:, old] + (pulse - self.pulse)
            quality[:, new] = self.last.quality[:, old]
        return LastDetections(age, quality)

    @staticmethod
    def after(
        numbers: Ints, last: LastDetections, views: VisibleViews, first: int, pulse: int
    ) -> RecentViews:
        """Return the last views before a later pulse, updated by the views from `first` on."""
        return RecentViews(pulse, numbers, last.advanced_to(views, pulse - first))
