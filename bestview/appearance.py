"""Appearance that can be compared between cameras: histograms equalised by what each camera sees."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_POINTS = 33
"""Quantiles at which equalised CDFs are compared."""

_PRIOR_TRACKS = 3.0
"""How many tracks a camera must have seen before its own people count as much as "all greys alike".

With one person alone, a camera's mean is that person, and equalising by it would make everyone alike.
"""

_KNOWN_PAIRS = 2000
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
        self._different: deque[float] = deque(maxlen=_KNOWN_PAIRS)

    def learn(self, camera: str, histogram: NDArray[np.float64]) -> None:
        """Count one more track of `camera` by its normalised (B,) histogram."""
        place = (camera, histogram.size)
        self._sums[place] = self._sums.get(place, np.zeros_like(histogram)) + histogram

    def equalised(self, camera: str, histogram: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cumulative histogram at equal steps of the camera's own greys: (B,) -> (33,), rising 0 to 1."""
        prior = np.full(histogram.size, _PRIOR_TRACKS / histogram.size)
        reference = np.cumsum(prior + self._sums.get((camera, histogram.size), 0.0))
        edges = np.concatenate([[0.0], reference / reference[-1]])
        cumulative = np.concatenate([[0.0], np.cumsum(histogram)])
        return np.asarray(np.interp(np.linspace(0.0, 1.0, _POINTS), edges, cumulative))

    def learn_different(self, distances: NDArray[np.float64]) -> None:
        """Remember distances between people who were seen side by side in one camera."""
        self._different.extend(float(d) for d in distances)

    def gate(self, most: float, share: float) -> float:
        """Distance below which two histograms are likely one person's.

        At most `most`, and at most `share` of the lower quartile of what differs between different
        people: where everyone looks alike, appearance joins nobody.
        """
        if len(self._different) < _ENOUGH_PAIRS:
            return most
        return min(most, share * float(np.percentile(np.array(self._different), 25)))


def distances(curves: Sequence[NDArray[np.float64] | None]) -> NDArray[np.float64]:
    """Mean absolute difference between T cumulative histograms, every pair: (T, T).

    It is the earth mover's distance between the histograms, in units of the whole grey axis; NaN where
    there is no histogram.
    """
    table = np.array([np.full(_POINTS, np.nan) if curve is None else curve for curve in curves])
    table = table.reshape(len(curves), _POINTS)
    return np.asarray(np.abs(table[:, None, :] - table[None, :, :]).mean(axis=-1))


def normalised(histogram: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Scale a histogram to sum 1; None when it holds nothing that can be compared."""
    total = float(histogram.sum())
    if not (np.isfinite(total) and total > 0 and histogram.min() >= 0):
        return None
    return np.asarray(histogram / total, dtype=np.float64)
