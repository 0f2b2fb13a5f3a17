"""Mean histograms, by camera: how somebody looked where nobody else was in the box."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """Mean histogram in one camera.

    Attributes:
        total: (B,) sum of normalised histograms.
        count: frames that went into it.
    """

    total: Floats
    count: int

    @classmethod
    def of(cls, histogram: Floats, frames: int) -> Look:
        """Take the mean histogram (B,) of some frames; one that nothing can be compared with counts none."""
        total = float(histogram.sum())
        if not np.isfinite(total) or total <= 0 or float(histogram.min()) < 0:
            return cls(np.zeros_like(histogram), 0)
        return cls(histogram * (frames / total), frames)

    @property
    def mean(self) -> Floats:
        """(B,), summing to 1."""
        return self.total / self.count


@dataclass(slots=True)
class Looks:
    """How one person looks, by camera."""

    by_camera: dict[str, Look] = field(default_factory=dict)

    def add(self, camera: str, look: Look) -> None:
        """Take in more. Another number of bins begins anew: the two cannot be compared."""
        if not look.count:
            return
        mine = self.by_camera.get(camera)
        if mine is not None and mine.total.size == look.total.size:
            look = Look(mine.total + look.total, mine.count + look.count)
        self.by_camera[camera] = look

    def add_all(self, other: Looks) -> None:
        """Take in all of somebody's looks."""
        for camera, look in sorted(other.by_camera.items()):
            self.add(camera, look)
