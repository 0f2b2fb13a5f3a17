"""How the person of an id looks, and what the track sees now: to notice that it is somebody else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats


class AppearanceMemory:
    """Appearance of an id over seconds, beside the latest sightings of the track that has it.

    Attributes:
        first: frame in which the id was first seen.
        last: frame in which it was seen last; None: not yet.
        histogram: (B,) mean of sightings without overlap; None: not known yet.
        latest: histograms of the latest sightings without overlap, in a row.
        met: by id of others, the last frame in which they overlapped.
    """

    __slots__ = ("_count", "first", "histogram", "last", "latest", "met")

    def __init__(self) -> None:
        self.first: int | None = None
        self.last: int | None = None
        self.histogram: Floats | None = None
        self._count = 0
        self.latest: list[Floats] = []
        self.met: dict[int, int] = {}

    def copy(self) -> AppearanceMemory:
        """Return a copy."""
        other = AppearanceMemory()
        other.first, other.last, other.latest, other.met = self.first, self.last, [*self.latest], {**self.met}
        other.take_id_of(self)
        return other

    def take_id_of(self, other: AppearanceMemory) -> None:
        """Take over what is known of an id."""
        self.first, self.histogram, self._count = other.first, other.histogram, other._count

    def start(self, histograms: Sequence[Floats]) -> None:
        """Begin with the mean of histograms."""
        self.histogram, self._count = np.mean(histograms, axis=0), len(histograms)

    def learn(self, histogram: Floats, most: int) -> None:
        """Add a histogram to a mean of `most` histograms at most."""
        if self.histogram is not None:
            self._count = min(self._count + 1, most)
            self.histogram = self.histogram + (histogram - self.histogram) / self._count
