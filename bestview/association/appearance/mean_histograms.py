"""Mean color histograms of a person, by camera, from frames in which nobody else is in the box."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class MeanHistogram:
    """Mean histogram in one camera.

    Attributes:
        histogram_sum: (B,) sum of normalized histograms.
        frame_count: frames that went into it.
    """

    histogram_sum: Floats
    frame_count: int

    @classmethod
    def of(cls, histogram: Floats, frames: int) -> MeanHistogram:
        """Build it from the mean histogram (B,) of some frames; an invalid one counts no frames."""
        total = float(histogram.sum())
        if not np.isfinite(total) or total <= 0 or float(histogram.min()) < 0:
            return cls(np.zeros_like(histogram), 0)
        return cls(histogram * (frames / total), frames)

    @property
    def mean(self) -> Floats:
        """(B,), summing to 1."""
        return self.histogram_sum / self.frame_count


@dataclass(slots=True)
class PersonAppearance:
    """Mean histograms of one person, by camera."""

    by_camera: dict[str, MeanHistogram] = field(default_factory=dict)

    def add(self, camera: str, histogram: MeanHistogram) -> None:
        """Add a histogram. Another number of bins replaces the old one: the two cannot be compared."""
        if not histogram.frame_count:
            return
        known = self.by_camera.get(camera)
        if known is not None and known.histogram_sum.size == histogram.histogram_sum.size:
            histogram = MeanHistogram(
                known.histogram_sum + histogram.histogram_sum, known.frame_count + histogram.frame_count
            )
        self.by_camera[camera] = histogram

    def add_all(self, other: PersonAppearance) -> None:
        """Add all histograms of another appearance."""
        for camera, histogram in sorted(other.by_camera.items()):
            self.add(camera, histogram)
