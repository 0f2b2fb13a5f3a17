"""Travel times between cameras, learned from people who were re-identified by appearance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview.association.settings import ResolvedIdentitySettings

Floats = NDArray[np.float64]

_BIN_RATIO = 2.0
"""Ratio of successive time bins: finer ones take longer to fill and differ by chance."""
_NEIGHBOR_BIN_SHARE = 0.25
"""Share of a transition that goes into each of the neighboring bins: times vary."""
_PRIOR_COUNT = 1.0
"""Weight of the uniform prior over cameras and times, in transitions."""
_HISTORY_LIMIT = 64
"""Transitions out of a camera beyond which its counts are halved, so that new habits count."""


@dataclass(frozen=True, slots=True)
class CameraSighting:
    """Camera and frame of a person's first or last sighting."""

    camera: str
    frame: int


@dataclass(slots=True, eq=False)
class _DepartureCounts:
    """Transitions out of one camera: their number, and by the next camera (B,) counts for each time bin."""

    transitions: float = 0.0
    arrivals: dict[str, Floats] = field(default_factory=dict)


class TravelTimeModel:
    """Learns transitions between cameras, and scores how plausible an arrival is.

    Args:
        settings: `maximum_travel_frames` and related ones.
        cameras: how many there are.
    """

    def __init__(self, settings: ResolvedIdentitySettings, cameras: int) -> None:
        self._settings, self._cameras = settings, max(cameras, 1)
        self.bin_edges = travel_time_bins(settings.maximum_travel_frames)
        self._departures: dict[str, _DepartureCounts] = {}

    def learn(self, departure: CameraSighting, arrival: CameraSighting) -> None:
        """Count a transition of a re-identified person; one that took too long is ignored."""
        bin_index = self._bin(arrival.frame - departure.frame)
        if bin_index < 0:
            return
        exits = self._departures.setdefault(departure.camera, _DepartureCounts())
        times = exits.arrivals.setdefault(arrival.camera, np.zeros(self.bin_edges.size - 1))
        for offset, share in (
            (-1, _NEIGHBOR_BIN_SHARE),
            (0, 1.0 - 2.0 * _NEIGHBOR_BIN_SHARE),
            (1, _NEIGHBOR_BIN_SHARE),
        ):
            times[min(max(bin_index + offset, 0), times.size - 1)] += share
        exits.transitions += 1.0
        if exits.transitions > _HISTORY_LIMIT:
            exits.transitions /= 2.0
            exits.arrivals = {camera: known / 2.0 for camera, known in exits.arrivals.items()}

    def evidence(self, arrivals: Sequence[CameraSighting], departures: Sequence[CameraSighting]) -> Floats:
        """Compute the log-likelihood ratio of arriving from a camera in that time, against chance.

        By chance people arrive at any camera, at any time up to `maximum_travel_frames`. Of *n* transitions
        out of a camera, *m* to the other, *h* in the bin of that time, whose share of all times is *w*, with
        *C* cameras:

            E = n / (n + travel_half_weight_count) ln( C (m + 1/C) / (n + 1) (h / w + 1) / (m + 1) )

        Args:
            arrivals: N first sightings.
            departures: L last sightings.

        Returns:
            (N, L); 0 where nothing is known, or the transition would take no time or too long.
        """
        values = [self._of(arrival, departure) for arrival in arrivals for departure in departures]
        return np.array(values, dtype=np.float64).reshape(len(arrivals), len(departures))

    def _of(self, arrival: CameraSighting, departure: CameraSighting) -> float:
        bin_index, counts = self._bin(arrival.frame - departure.frame), self._departures.get(departure.camera)
        if bin_index < 0 or counts is None:
            return 0.0
        times = counts.arrivals.get(arrival.camera)
        transitions, in_bin = (0.0, 0.0) if times is None else (float(times.sum()), float(times[bin_index]))
        # Both relative to chance: one of all cameras, and the bin's share of all times.
        camera_ratio = (
            self._cameras * (transitions + _PRIOR_COUNT / self._cameras) / (counts.transitions + _PRIOR_COUNT)
        )
        width = float(self.bin_edges[bin_index + 1] - self.bin_edges[bin_index]) / float(
            self.bin_edges[-1] - self.bin_edges[0]
        )
        time_ratio = (in_bin / width + _PRIOR_COUNT) / (transitions + _PRIOR_COUNT)
        reliability = (
            counts.transitions / (counts.transitions + self._settings.travel_half_weight_count)
            if counts.transitions
            else 0.0
        )
        cap = self._settings.maximum_travel_evidence
        return float(reliability * np.clip(np.log(camera_ratio * time_ratio), -cap, cap))

    def _bin(self, frames: int) -> int:
        """Return the index of a time's bin; -1: none."""
        if not 1 <= frames < self.bin_edges[-1]:
            return -1
        return int(np.searchsorted(self.bin_edges, frames, side="right")) - 1


def travel_time_bins(longest: int) -> Floats:
    """Return the edges of time bins from 1 to `longest` frames, each twice as long as the one before."""
    edges = [1.0]
    while edges[-1] * _BIN_RATIO < longest:
        edges.append(edges[-1] * _BIN_RATIO)
    return np.array([*edges, longest + 1.0])
