"""Appearance distances of one and of two people in each camera, learned from certain pairs."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import AffinityMatrix
from bestview.association.appearance.histograms import MeanHistogram
from bestview.association.appearance.likelihood import DistanceScale, bhattacharyya_distances
from bestview.association.tracklet import Tracklet

Floats = NDArray[np.float64]

_HISTORY_LIMIT = 500
"""Stored distances of each kind and camera."""


class DistanceScales:
    """Learns from active tracklets, and stores the distances of settled ones.

    Args:
        minimum_frames: that a histogram needs to be used.
        continuous_gap: frames within which a continued track shows how much one person's appearance varies.
    """

    def __init__(self, minimum_frames: int, continuous_gap: int) -> None:
        self._minimum_frames, self._continuous_gap = minimum_frames, continuous_gap
        self._same_person: dict[str, Floats] = {}
        self._different_people: dict[str, Floats] = {}

    def of(
        self, camera: str, rows: Sequence[int], tracklets: Sequence[Tracklet], affinity: AffinityMatrix
    ) -> DistanceScale:
        """Return the scale of a camera, including the distances of its active tracklets.

        Args:
            camera: its name.
            rows: of its tracklets.
            tracklets: of all cameras.
            affinity: cannot-links between them.
        """
        same_person, different_people = self._distances(camera, rows, tracklets, affinity, rows)
        return DistanceScale.learned(
            _extended(self._same_person, camera, same_person),
            _extended(self._different_people, camera, different_people),
        )

    def keep_distances_of_settling(
        self, settled_rows: Collection[int], tracklets: Sequence[Tracklet], affinity: AffinityMatrix
    ) -> None:
        """Store the distances of tracklets that are about to be settled, given by their rows."""
        rows_of: dict[str, list[int]] = {
            camera: [] for row in settled_rows for camera in tracklets[row].appearance.by_camera
        }
        for row, tracklet in enumerate(tracklets):
            for camera in tracklet.appearance.by_camera:
                if camera in rows_of:
                    rows_of[camera].append(row)
        for camera, rows in sorted(rows_of.items()):
            same_person, different_people = self._distances(camera, rows, tracklets, affinity, settled_rows)
            self._same_person[camera] = _extended(self._same_person, camera, same_person)[-_HISTORY_LIMIT:]
            self._different_people[camera] = _extended(self._different_people, camera, different_people)[
                -_HISTORY_LIMIT:
            ]

    def _distances(
        self,
        camera: str,
        rows: Sequence[int],
        tracklets: Sequence[Tracklet],
        affinity: AffinityMatrix,
        selected_rows: Collection[int],
    ) -> tuple[Floats, Floats]:
        """Return the distances of selected tracklets to their predecessors, and to those of other people."""
        histograms = {
            row: histogram
            for row in rows
            if (histogram := self._histogram(tracklets[row], camera)) is not None
        }
        if not histograms:
            return np.zeros(0), np.zeros(0)
        bins = next(reversed(histograms.values())).histogram_sum.size
        rows = [row for row, histogram in histograms.items() if histogram.histogram_sum.size == bins]
        place = {id(tracklets[row]): i for i, row in enumerate(rows)}
        mean = np.array([histograms[row].mean for row in rows])
        distance = bhattacharyya_distances(mean, mean)
        row_of = np.array(rows, dtype=np.int64)
        selected = np.isin(row_of, np.array(list(selected_rows), dtype=np.int64))
        same_person: list[float] = []
        for i in np.flatnonzero(selected).tolist():
            tracklet = tracklets[rows[i]]
            if (
                tracklet.predecessor is not None
                and id(tracklet.predecessor) in place
                and tracklet.frames_since_predecessor <= self._continuous_gap
            ):
                same_person.append(float(distance[i, place[id(tracklet.predecessor)]]))
        first, second = np.triu_indices(len(rows), 1)
        relevant = selected[first] | selected[second]
        first, second = first[relevant], second[relevant]
        rivals = affinity.cannot_link(row_of[first], row_of[second])
        return np.array(same_person, dtype=np.float64), distance[first[rivals], second[rivals]]

    def _histogram(self, tracklet: Tracklet, camera: str) -> MeanHistogram | None:
        histogram = tracklet.appearance.by_camera.get(camera)
        return histogram if histogram is not None and histogram.frame_count >= self._minimum_frames else None


def _extended(known: dict[str, Floats], camera: str, more: Floats) -> Floats:
    """Return the known distances of a camera, extended by more."""
    return np.concatenate([known[camera], more]) if camera in known else more
