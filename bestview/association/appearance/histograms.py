"""Mean color histograms of people, and their equalization between cameras."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CDF_POINTS = 33
"""Quantiles at which equalized CDFs are compared."""
_PRIOR_TRACKS = 3.0
"""How many tracks a camera must have seen before its people count as much as a uniform gray distribution.

With one person alone, a camera's mean is that person, and equalization by it would make everyone alike.
"""
MAXIMUM_DIFFERENT_PAIRS = 2000
"""Distances between different people that are stored."""
_ENOUGH_PAIRS = 10


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
        """Build it from the (B,) mean histogram of `frames` frames; an invalid one counts as no frames."""
        total = float(histogram.sum())
        if not np.isfinite(total) or total <= 0 or float(histogram.min()) < 0:
            return cls(np.zeros_like(histogram), 0)
        return cls(histogram * (frames / total), frames)

    def added_to(self, known: MeanHistogram | None) -> MeanHistogram:
        """Return the mean over the frames of both; one of other bins is replaced: they cannot be compared."""
        if known is None or known.histogram_sum.size != self.histogram_sum.size:
            return self
        total = known.histogram_sum + self.histogram_sum
        return MeanHistogram(total, known.frame_count + self.frame_count)

    @property
    def mean(self) -> Floats:
        """(B,), summing to 1."""
        return self.histogram_sum / self.frame_count


@dataclass(slots=True)
class PersonAppearance:
    """Mean histograms of one person, by camera, from frames in which no other person is in the box."""

    by_camera: dict[str, MeanHistogram] = field(default_factory=dict)

    def add(self, camera: str, histogram: MeanHistogram) -> None:
        """Add a histogram."""
        if histogram.frame_count:
            self.by_camera[camera] = histogram.added_to(self.by_camera.get(camera))

    def add_all(self, other: PersonAppearance) -> None:
        """Add all histograms of another appearance."""
        for camera, histogram in sorted(other.by_camera.items()):
            self.add(camera, histogram)


class HistogramEqualizer:
    """Equalizes histograms, and learns how much the histograms of different people differ.

    The same coat is brighter in one camera than in another. If all cameras see about the same people, the
    gray level below which 30 % of all pixels lie is the same in each: a histogram is compared after its bins
    are mapped through its camera's mean cumulative histogram (histogram equalization).
    """

    def __init__(self) -> None:
        self._sums: dict[tuple[str, int], NDArray[np.float64]] = {}
        self._different: deque[float] = deque(maxlen=MAXIMUM_DIFFERENT_PAIRS)

    def learn(self, camera: str, histogram: NDArray[np.float64]) -> None:
        """Count one more track of `camera` by its normalized (B,) histogram."""
        key = (camera, histogram.size)
        self._sums[key] = self._sums.get(key, np.zeros_like(histogram)) + histogram

    def equalize(self, camera: str, histograms: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return equalized cumulative histograms: (N, B) -> (N, 33), rising to 1."""
        bins = histograms.shape[1]
        prior = np.full(bins, _PRIOR_TRACKS / bins)
        return equalized_by(prior + self._sums.get((camera, bins), 0.0), histograms)

    def reference_histogram(self, bins: int) -> NDArray[np.float64]:
        """Return how all cameras render people: the sum of all tracks' normalized histograms, (B,)."""
        sums = [total for (_, size), total in self._sums.items() if size == bins]
        return np.asarray(np.sum([np.zeros(bins), *sums], axis=0))

    def add_different_people(self, distances: NDArray[np.float64]) -> None:
        """Store distances between people who were seen simultaneously in one camera."""
        self._different.extend(distances[-MAXIMUM_DIFFERENT_PAIRS:].tolist())

    def same_person_gate(self, maximum: float, quartile_factor: float) -> float:
        """Return the distance below which two histograms are likely of one person.

        At most `maximum`, and at most `quartile_factor` times the lower quartile of the distances between
        different people: where all look alike, appearance decides nothing.
        """
        if len(self._different) < _ENOUGH_PAIRS:
            return maximum
        return min(maximum, quartile_factor * float(np.percentile(np.array(self._different), 25)))


def equalized_by(reference: NDArray[np.float64], histograms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return cumulative histograms over the quantiles of a reference: (B,) and (N, B) -> (N, 33)."""
    bins = histograms.shape[1]
    total = np.cumsum(reference)
    edges = np.concatenate([[0.0], total / total[-1]])
    cumulative = np.cumsum(np.pad(histograms, ((0, 0), (1, 0))), axis=1)
    # The positions of the steps between the edges are the same for all histograms.
    steps = np.linspace(0.0, 1.0, CDF_POINTS)
    left = np.minimum(np.searchsorted(edges, steps, side="right") - 1, bins - 1)
    slope = (cumulative[:, left + 1] - cumulative[:, left]) / (edges[left + 1] - edges[left])
    inside = slope * (steps - edges[left]) + cumulative[:, left]
    return np.asarray(np.where(steps < edges[-1], inside, cumulative[:, -1:]))


def cdf_distance(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute mean absolute differences between cumulative histograms: (..., 33) and (..., 33) -> (...).

    It is the earth mover's distance between the histograms, in units of the whole gray axis; NaN where there
    is no histogram.
    """
    return np.asarray(np.abs(first - second).mean(axis=-1))
