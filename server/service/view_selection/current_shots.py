"""Who was shown by which camera last, and for how long."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA

Ints = NDArray[np.int64]


def _nobody() -> Ints:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class CurrentShots:
    """The shots that are running.

    Attributes:
        numbers: (K,) whose they are, rising.
        cameras: (K,) who shows each of them, by index; -1: none so far.
        held: (K,) for how many GOPs, holes included; at least 1.
    """

    numbers: Ints = field(default_factory=_nobody)
    cameras: Ints = field(default_factory=_nobody)
    held: Ints = field(default_factory=_nobody)

    def of(self, numbers: Ints) -> CurrentShots:
        """Return the shots of these people, (K,) rising; who is new has none."""
        cameras, held = (
            np.full(len(numbers), NO_CAMERA, dtype=np.int64),
            np.ones(len(numbers), dtype=np.int64),
        )
        _, old, new = np.intersect1d(self.numbers, numbers, assume_unique=True, return_indices=True)
        cameras[new], held[new] = self.cameras[old], self.held[old]
        return CurrentShots(numbers, cameras, held)

    def then(self, views: Ints) -> CurrentShots:
        """Return the shots after one more GOP that these cameras (K,) show; -1 is a hole, which is no cut."""
        cameras = np.where(views == NO_CAMERA, self.cameras, views)
        return CurrentShots(self.numbers, cameras, np.where(cameras == self.cameras, self.held + 1, 1))
