"""Affinity fusion: all evidence about pairs of tracklets and people added up, and clustered."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import AffinityMatrix
from bestview.association.affinity.candidate_links import CandidateLinks, split_into_batches
from bestview.association.affinity.evidence import PairEvidence
from bestview.association.appearance.distance_scales import DistanceScales
from bestview.association.appearance.histograms import MeanHistogram
from bestview.association.appearance.likelihood import AppearanceWeights, CameraAppearances
from bestview.association.clustering import cluster
from bestview.association.registry.person import Person
from bestview.association.settings import ResolvedIdentitySettings
from bestview.association.tracklet import Tracklet

Ints = NDArray[np.int64]


class AffinityFusion:
    """Clusters the active tracklets and the known people into persons.

    Args:
        settings: of identity.
        calibrated: by camera, whether it has a homography.
        walking_speed: largest distance walked in a frame, person heights.
    """

    def __init__(
        self, settings: ResolvedIdentitySettings, calibrated: Mapping[str, bool], walking_speed: float
    ) -> None:
        self._settings, self._calibrated, self._walking_speed = settings, calibrated, walking_speed
        self._scales = DistanceScales(settings.appearance_frames, max(settings.crowd_frames, 1))
        self._weights = AppearanceWeights(
            settings.appearance_evidence, settings.maximum_appearance_evidence, settings.appearance_frames
        )

    def cluster(
        self,
        tracklets: Sequence[Tracklet],
        people: Sequence[Person],
        visible_people: NDArray[np.bool_],
        affinity: AffinityMatrix,
        height: float,
    ) -> Ints:
        """Cluster all rows, tracklets first, then people.

        Args:
            tracklets: active ones.
            people: known people with settled tracklets.
            visible_people: (P,) people seen by settled tracklets that continue.
            affinity: of all pairs of both.
            height: of a person in ground units.

        Returns:
            (N,) the lowest row of each row's cluster.
        """
        count = len(tracklets) + len(people)
        evidence = PairEvidence(
            tracklets, people, affinity, self._calibrated, self._settings, height, self._walking_speed
        )
        appearances = self._collect_appearances(tracklets, people, affinity)
        links = CandidateLinks.find(evidence, appearances, self._weights, len(tracklets), count)
        unseen = np.concatenate([np.zeros(len(tracklets), dtype=np.bool_), ~visible_people])
        group = np.arange(count)
        for batch in split_into_batches(links, evidence, appearances):
            label = cluster(
                batch.evidence,
                batch.cannot_link,
                unseen[batch.rows],
                batch.linked,
                batch.appearance,
                self._weights,
                self._settings.merge_threshold,
            )
            group[batch.rows] = batch.rows[label]
        return group

    def _collect_appearances(
        self, tracklets: Sequence[Tracklet], people: Sequence[Person], affinity: AffinityMatrix
    ) -> list[CameraAppearances]:
        """Collect the mean histograms of all rows, camera by camera."""
        by_camera: dict[str, list[tuple[int, MeanHistogram]]] = {camera: [] for camera in self._calibrated}
        rows_by_camera: dict[str, list[int]] = {camera: [] for camera in self._calibrated}
        for row, tracklet in enumerate(tracklets):
            for camera in tracklet.appearance.by_camera:
                rows_by_camera[camera].append(row)
        for row, appearance in enumerate(
            [tracklet.appearance for tracklet in tracklets] + [person.appearance for person in people]
        ):
            for name, histogram in appearance.by_camera.items():
                by_camera[name].append((row, histogram))
        appearances = []
        for camera, histograms in by_camera.items():
            comparable = select_with_bins_of_newest(histograms, len(tracklets))
            if len(comparable) > 1:
                rows = np.array([row for row, _ in comparable], dtype=np.int64)
                total = np.array([histogram.histogram_sum for _, histogram in comparable])
                count = np.array([histogram.frame_count for _, histogram in comparable], dtype=np.float64)
                scale = self._scales.of(camera, rows_by_camera[camera], tracklets, affinity)
                appearances.append(CameraAppearances(rows, total, count, scale))
        return appearances

    def keep_distances_of_settling(
        self, old: Collection[int], tracklets: Sequence[Tracklet], affinity: AffinityMatrix
    ) -> None:
        """Store the appearance distances of tracklets that are about to be settled, given by their rows."""
        self._scales.keep_distances_of_settling(old, tracklets, affinity)


def select_with_bins_of_newest(
    histograms: Sequence[tuple[int, MeanHistogram]], active_rows: int
) -> list[tuple[int, MeanHistogram]]:
    """Return the histograms with as many bins as the newest of rows below `active_rows`, or of any."""
    newest = [histogram for row, histogram in histograms if row < active_rows] or [
        histogram for _, histogram in histograms
    ]
    return [
        (row, histogram)
        for row, histogram in histograms
        if histogram.histogram_sum.size == newest[-1].histogram_sum.size
    ]
