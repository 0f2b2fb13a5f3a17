"""Appearance evidence between cameras without common ground: all tracklets of two cameras are compared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import SCORED_S, AffinityMatrix
from bestview.association.appearance.histograms import (
    CDF_POINTS,
    MAXIMUM_DIFFERENT_PAIRS,
    HistogramEqualizer,
    MeanHistogram,
    cdf_distance,
)
from bestview.association.settings import ResolvedIdentitySettings
from bestview.association.tracklet import Tracklet, TrackletKey

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
_MINIMUM_HISTOGRAM_S = 0.8
"""Seconds from which a mean histogram represents the person rather than the moment..."""
_MINIMUM_HISTOGRAM_FRAMES = 3
"""... and at least so many frames."""
_MAXIMUM_SCORE = 0.5
"""Largest score of one update."""
_SWAP_MARGIN = 0.4
"""Share of the gate by which any exchange of partners must be worse for a pair to count."""


class TrackletInCamera(NamedTuple):
    """A tracklet in one of the cameras that see it."""

    key: TrackletKey
    camera: str


class CrossCameraAppearance:
    """Collects appearance evidence about tracklets of cameras without common ground.

    Learns how each camera renders people, and how much different people differ.

    Args:
        settings: of identity.
        calibrated: by camera; two calibrated cameras are compared on the ground instead.
    """

    def __init__(self, settings: ResolvedIdentitySettings, calibrated: Mapping[str, bool]) -> None:
        self._settings, self._calibrated = settings, calibrated
        self._minimum_frames = max(round(_MINIMUM_HISTOGRAM_S * settings.fps), _MINIMUM_HISTOGRAM_FRAMES)
        self.equalizer = HistogramEqualizer()
        self._learned: set[TrackletInCamera] = set()

    @property
    def same_person_gate(self) -> float:
        """Distance below which two histograms are likely of one person."""
        return self.equalizer.same_person_gate(
            self._settings.appearance_gate, self._settings.appearance_gate_share
        )

    def share_ground(self, first: Iterable[str], second: Iterable[str]) -> bool:
        """Return whether two of these cameras have a common ground plane."""
        return any(self._calibrated[camera] for camera in first) and any(
            self._calibrated[camera] for camera in second
        )

    def update(
        self,
        tracklets: Sequence[Tracklet],
        rows: Ints,
        affinity: AffinityMatrix,
        elapsed_s: float = SCORED_S,
    ) -> None:
        """Compare the tracklets that an update has observed.

        Args:
            tracklets: all active ones.
            rows: (P,) those that the update has observed.
            affinity: receives the evidence.
            elapsed_s: seconds since the last update.
        """
        active = {tracklet.key for tracklet in tracklets}
        self._learned = {seen for seen in self._learned if seen.key in active}
        observed = sorted(rows.tolist(), key=lambda row: tracklets[row].key)
        names = [tracklets[row].key.camera for row in observed]
        starts = [i for i, name in enumerate(names) if i == 0 or names[i - 1] != name]
        cameras = [slice(start, end) for start, end in pairwise([*starts, len(names)])]
        curves = self._curves([tracklets[row] for row in observed], cameras)
        row_of = np.array(observed, dtype=np.int64)

        def distances_between(first: slice, second: slice) -> Floats:
            return cdf_distance(curves[first][:, None], curves[second][None, :])

        # Pairs seen simultaneously in one camera, from the last camera back until there are enough.
        different_people: list[Floats] = []
        for camera in reversed(cameras):
            if sum(first.size for first in different_people) < MAXIMUM_DIFFERENT_PAIRS:
                within = distances_between(camera, camera)
                i, j = np.nonzero(np.triu(~np.isnan(within), 1))
                rivals = affinity.cannot_link(row_of[camera][i], row_of[camera][j])
                different_people.append(within[i[rivals], j[rivals]])
        self.equalizer.add_different_people(np.concatenate([np.zeros(0), *reversed(different_people)]))
        scores = score_camera_assignments(
            cameras,
            [self._calibrated[names[camera.start]] for camera in cameras],
            distances_between,
            self.same_person_gate,
        )
        first, second = row_of[scores.first], row_of[scores.second]
        affinity.add_appearance_evidence(first, second, scores.score, elapsed_s)

    def _curves(self, tracklets: Sequence[Tracklet], cameras: Sequence[slice]) -> Floats:
        """Return equalized cumulative histograms (P, 33), NaN where a histogram has too few frames."""
        curves = np.full((len(tracklets), CDF_POINTS), np.nan)
        for camera in cameras:
            for tracklet in tracklets[camera]:
                self._learn(tracklet)
            alike: dict[tuple[str, int], list[tuple[int, Floats]]] = {}
            for index in range(camera.start, camera.stop):
                best = self._best_histogram(tracklets[index])
                if best is not None:
                    name, histogram = best
                    alike.setdefault((name, histogram.histogram_sum.size), []).append((index, histogram.mean))
            for (name, _), rows in alike.items():
                means = np.array([mean for _, mean in rows])
                curves[[index for index, _ in rows]] = self.equalizer.equalize(name, means)
        return curves

    def _learn(self, tracklet: Tracklet) -> None:
        """Learn how cameras render people, once per tracklet: who stays must not weigh more."""
        for name, histogram in tracklet.appearance.by_camera.items():
            seen = TrackletInCamera(tracklet.key, name)
            if histogram.frame_count >= self._minimum_frames and seen not in self._learned:
                self._learned.add(seen)
                self.equalizer.learn(name, histogram.mean)

    def _best_histogram(self, tracklet: Tracklet) -> tuple[str, MeanHistogram] | None:
        """Return the histogram with the most frames, and its camera; None: too few frames in every camera."""
        frames, name = max(
            ((histogram.frame_count, name) for name, histogram in tracklet.appearance.by_camera.items()),
            default=(0, ""),
        )
        return (name, tracklet.appearance.by_camera[name]) if frames >= self._minimum_frames else None


@dataclass(frozen=True, slots=True)
class PairScores:
    """Scores of P pairs of tracklets of different cameras.

    Attributes:
        first: (P,) rows.
        second: (P,) rows, above `first`.
        score: (P,).
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    score: NDArray[np.float64]

    @classmethod
    def concatenate(cls, parts: Sequence[PairScores]) -> PairScores:
        """Concatenate scores of different pairs."""
        none = cls(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
        every = [none, *parts]
        return cls(
            np.concatenate([part.first for part in every]),
            np.concatenate([part.second for part in every]),
            np.concatenate([part.score for part in every]),
        )


def score_camera_assignments(
    cameras: Sequence[slice],
    calibrated: Sequence[bool],
    distances_between: Callable[[slice, slice], NDArray[np.float64]],
    gate: float,
) -> PairScores:
    """Score the appearance similarity of tracklets of every two cameras without common ground.

    The tracklets of two cameras are assigned to each other as a whole, with the least total distance. A pair
    of that assignment counts for one person only if no exchange of partners would be nearly as good; a pair
    further apart than the gate counts against; all others score 0.

    Args:
        cameras: rows of each camera's tracklets, rising.
        calibrated: for each camera; two calibrated ones are compared on the ground instead.
        distances_between: (A, B) appearance distances between two cameras' rows; NaN: unknown.
        gate: distance above which two histograms are two people's.

    Returns:
        Scores in [-0.5, 0.5] where the distance is known.
    """
    parts = []
    for (first, first_calibrated), (second, second_calibrated) in combinations(
        zip(cameras, calibrated, strict=True), 2
    ):
        if not (first_calibrated and second_calibrated):
            score = _score_matrix(distances_between(first, second), gate)
            row, column = np.nonzero(~np.isnan(score))
            parts.append(PairScores(first.start + row, second.start + column, score[row, column]))
    return PairScores.concatenate(parts)


def _score_matrix(distances: NDArray[np.float64], gate: float) -> NDArray[np.float64]:
    """Compute the scores of (A, B) pairs; NaN: unknown."""
    gate_ratio = np.full(distances.shape, np.nan)
    np.divide(distances, gate, out=gate_ratio, where=~np.isnan(distances) & (gate > 0))
    if np.isnan(gate_ratio).all():
        return gate_ratio
    score = np.where(_unambiguous_pairs(gate_ratio), 1.0 - gate_ratio, np.clip(1.0 - gate_ratio, -1.0, 0.0))
    return _MAXIMUM_SCORE * score


def _unambiguous_pairs(gate_ratio: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the pairs of the best assignment of (A, B) distances for which no exchange is nearly as good."""
    rows, columns = gate_ratio.shape
    # Padded with the cost of a gate for rows and columns without a partner.
    square = np.ones((rows + columns, rows + columns))
    square[:rows, :columns] = np.where(np.isnan(gate_ratio), 1.0, np.minimum(gate_ratio, 1.0))
    square[rows:, columns:] = 0.0
    _, partner = scipy.optimize.linear_sum_assignment(square)
    own_cost = square[np.arange(rows + columns), partner]
    swapped = square[:, partner]
    exchange = swapped + swapped.T - own_cost[:, None] - own_cost[None, :]
    np.fill_diagonal(exchange, np.inf)
    margin = exchange[:rows].min(axis=1, initial=np.inf)
    unambiguous = np.zeros((rows, columns), dtype=bool)
    for row in np.flatnonzero((partner[:rows] < columns) & (margin > _SWAP_MARGIN)).tolist():
        unambiguous[row, partner[row]] = gate_ratio[row, partner[row]] < 1
    return unambiguous
