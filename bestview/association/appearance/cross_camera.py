"""Appearance between cameras without common ground: all tracklets of two cameras compared at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import AffinityMatrix
from bestview.association.appearance.equalized_histograms import (
    CDF_POINTS,
    MAXIMUM_DIFFERENT_PAIRS,
    HistogramEqualizer,
    cdf_distances,
)
from bestview.association.appearance.mean_histograms import MeanHistogram
from bestview.association.appearance.similarity import score_camera_pairs
from bestview.association.keys import TrackletKey
from bestview.association.settings import IdentitySettings
from bestview.association.tracklet import Tracklet

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_MINIMUM_HISTOGRAM_FRAMES = 20
"""Frames after which a mean histogram is more the person's than the moment's."""


class CrossCameraAppearance:
    """Collects appearance evidence about tracklets of cameras without common ground.

    Learns how each camera renders people, and how much different people differ.

    Args:
        settings: of identity.
        calibrated: by camera; two calibrated cameras are compared on the ground instead.
    """

    def __init__(self, settings: IdentitySettings, calibrated: Mapping[str, bool]) -> None:
        self._settings, self._calibrated = settings, calibrated
        self.equalizer = HistogramEqualizer()
        self._learned: set[TrackletKey] = set()

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

    def update(self, tracklets: Sequence[Tracklet], rows: Ints, affinity: AffinityMatrix) -> None:
        """Compare the tracklets that an update has observed.

        Args:
            tracklets: all active ones.
            rows: (P,) those that the update has observed.
            affinity: receives the evidence.
        """
        self._learned &= {tracklet.key for tracklet in tracklets}
        observed = sorted(rows.tolist(), key=lambda row: tracklets[row].key)
        names = [tracklets[row].key.camera for row in observed]
        starts = [i for i, name in enumerate(names) if i == 0 or names[i - 1] != name]
        cameras = [slice(start, end) for start, end in pairwise([*starts, len(names)])]
        curves = self._curves([tracklets[row] for row in observed], cameras)
        row_of = np.array(observed, dtype=np.int64)

        def distances_between(first: slice, second: slice) -> Floats:
            return cdf_distances(curves[first][:, None], curves[second][None, :])

        # Who was seen side by side, back from the last camera to what is remembered of it.
        different_people: list[Floats] = []
        for camera in reversed(cameras):
            if sum(first.size for first in different_people) < MAXIMUM_DIFFERENT_PAIRS:
                within = distances_between(camera, camera)
                i, j = np.nonzero(np.triu(~np.isnan(within), 1))
                rivals = affinity.cannot_link(row_of[camera][i], row_of[camera][j])
                different_people.append(within[i[rivals], j[rivals]])
        self.equalizer.add_different_people(np.concatenate([np.zeros(0), *reversed(different_people)]))
        scores = score_camera_pairs(
            cameras,
            [self._calibrated[names[camera.start]] for camera in cameras],
            distances_between,
            self.same_person_gate,
        )
        first, second = row_of[scores.first], row_of[scores.second]
        affinity.add_appearance_evidence(first, second, scores.score)

    def _curves(self, tracklets: Sequence[Tracklet], cameras: Sequence[slice]) -> Floats:
        """Return equalized cumulative histograms (P, 33), NaN where a histogram has too few frames."""
        curves = np.full((len(tracklets), CDF_POINTS), np.nan)
        for camera in cameras:
            for tracklet in tracklets[camera]:
                histogram = _stable_histogram(tracklet)
                # Once per episode: somebody who stands about must not weigh more than who walks through.
                if histogram is not None and tracklet.key not in self._learned:
                    self._learned.add(tracklet.key)
                    self.equalizer.learn(tracklet.key.camera, histogram.mean)
            bins: dict[int, list[int]] = {}
            for index in range(camera.start, camera.stop):
                histogram = _stable_histogram(tracklets[index])
                if histogram is not None:
                    bins.setdefault(histogram.histogram_sum.size, []).append(index)
            for rows in bins.values():
                means = np.array(
                    [
                        tracklets[index].appearance.by_camera[tracklets[index].key.camera].mean
                        for index in rows
                    ]
                )
                curves[rows] = self.equalizer.equalize(tracklets[camera.start].key.camera, means)
        return curves


def _stable_histogram(tracklet: Tracklet) -> MeanHistogram | None:
    histogram = tracklet.appearance.by_camera.get(tracklet.key.camera)
    return histogram if histogram is not None and histogram.frame_count >= _MINIMUM_HISTOGRAM_FRAMES else None
