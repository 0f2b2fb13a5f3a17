"""Appearance that can be compared between cameras: histograms equalised by what each camera sees."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

POINTS = 33
"""Quantiles at which equalised CDFs are compared."""

_PRIOR_TRACKS = 3.0
"""How many tracks a camera must have seen before its own people count as much as "all greys alike".

With one person alone, a camera's mean is that person, and equalising by it would make everyone alike.
"""

KNOWN_PAIRS = 2000
"""Pairs of different people remembered, to know how different people look here."""

_ENOUGH_PAIRS = 10


class Appearances:
    """Histograms made comparable, and how much different people's histograms differ here.

    The same coat is brighter in one camera than in another. When all cameras see about the same people,
    the grey below which 30 % of all pixels lie is the same grey in each: a histogram is compared after
    its bins are mapped through its camera's mean cumulative histogram (histogram equalisation).
    """

    def __init__(self) -> None:
        self._sums: dict[tuple[str, int], NDArray[np.float64]] = {}
        self._different: deque[float] = deque(maxlen=KNOWN_PAIRS)

    def learn(self, camera: str, histogram: NDArray[np.float64]) -> None:
        """Count one more track of `camera` by its normalised (B,) histogram."""
        place = (camera, histogram.size)
        self._sums[place] = self._sums.get(place, np.zeros_like(histogram)) + histogram

    def equalised(self, camera: str, histograms: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cumulative histograms at equal steps of the camera's own greys: (N, B) -> (N, 33), rising to 1."""
        bins = histograms.shape[1]
        prior = np.full(bins, _PRIOR_TRACKS / bins)
        reference = np.cumsum(prior + self._sums.get((camera, bins), 0.0))
        edges = np.concatenate([[0.0], reference / reference[-1]])
        cumulative = np.cumsum(np.pad(histograms, ((0, 0), (1, 0))), axis=1)
        # Where the steps lie between the edges is the same for all.
        steps = np.linspace(0.0, 1.0, POINTS)
        left = np.minimum(np.searchsorted(edges, steps, side="right") - 1, bins - 1)
        slope = (cumulative[:, left + 1] - cumulative[:, left]) / (edges[left + 1] - edges[left])
        inside = slope * (steps - edges[left]) + cumulative[:, left]
        return np.asarray(np.where(steps < edges[-1], inside, cumulative[:, -1:]))

    def learn_different(self, distances: NDArray[np.float64]) -> None:
        """Remember distances between people who were seen side by side in one camera."""
        self._different.extend(distances[-KNOWN_PAIRS:].tolist())

    def gate(self, most: float, share: float) -> float:
        """Distance below which two histograms are likely one person's.

        At most `most`, and at most `share` of the lower quartile of what differs between different
        people: where everyone looks alike, appearance joins nobody.
        """
        if len(self._different) < _ENOUGH_PAIRS:
            return most
        return min(most, share * float(np.percentile(np.array(self._different), 25)))


def distances(one: NDArray[np.float64], two: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean absolute differences between cumulative histograms: (..., 33) and (..., 33) -> (...).

    It is the earth mover's distance between the histograms, in units of the whole grey axis; NaN where
    there is no histogram.
    """
    return np.asarray(np.abs(one - two).mean(axis=-1))
