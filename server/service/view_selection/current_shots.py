"""The running shot of each person: the camera, and for how long."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA

Ints = NDArray[np.int64]


def _empty() -> Ints:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class CurrentShots:
    """The running shots of K people.

    Attributes:
        numbers: (K,) person numbers, rising.
        cameras: (K,) index of the camera; -1: none so far.
        gops: (K,) length in GOPs, gaps included; at least 1.
    """

    numbers: Ints = field(default_factory=_empty)
    cameras: Ints = field(default_factory=_empty)
    gops: Ints = field(default_factory=_empty)

    def of(self, numbers: Ints) -> CurrentShots:
        """Return the shots of these people, (K,) rising; new people have none."""
        cameras, gops = (
            np.full(len(numbers), NO_CAMERA, dtype=np.int64),
            np.ones(len(numbers), dtype=np.int64),
        )
        _, old, new = np.intersect1d(self.numbers, numbers, assume_unique=True, return_indices=True)
        cameras[new], gops[new] = self.cameras[old], self.gops[old]
        return CurrentShots(numbers, cameras, gops)

    def then(self, views: Ints) -> CurrentShots:
        """Return the shots after one more GOP, shown by these cameras (K,); -1 is a gap, which is no cut."""
        cameras = np.where(views == NO_CAMERA, self.cameras, views)
        return CurrentShots(self.numbers, cameras, np.where(cameras == self.cameras, self.gops + 1, 1))
