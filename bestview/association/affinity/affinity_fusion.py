"""All that is known about who is one person, added up: for grouping everybody anew."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import PairTables
from bestview.association.affinity.candidate_links import Links, batches
from bestview.association.affinity.evidence import Evidence
from bestview.association.appearance.distance_scales import LookScales
from bestview.association.appearance.likelihood import CameraLooks, LookWeights
from bestview.association.appearance.mean_histograms import Look
from bestview.association.clustering import cluster
from bestview.association.registry.person import Person
from bestview.association.settings import IdentitySettings
from bestview.association.tracklet import Episode

Ints = NDArray[np.int64]


class Weighing:
    """Groups the open episodes, and the people as they were before, into people.

    Args:
        settings: of identity.
        calibrated: by camera, whether it has a ground.
        pace: how far somebody can walk in a frame, in person heights.
    """

    def __init__(self, settings: IdentitySettings, calibrated: Mapping[str, bool], pace: float) -> None:
        self._settings, self._calibrated, self._pace = settings, calibrated, pace
        self._scales = LookScales(settings.appearance_frames)
        self._weights = LookWeights(
            settings.appearance_evidence, settings.maximum_appearance_evidence, settings.appearance_frames
        )

    def grouped(
        self,
        episodes: Sequence[Episode],
        past: Sequence[Person],
        here: NDArray[np.bool_],
        tables: PairTables,
        height: float,
    ) -> Ints:
        """Give the group of each row, episodes first, then people: (N,) the lowest row of the group.

        Args:
            episodes: open ones.
            past: people as they were before.
            here: (P,) of these, who is seen by tracks that are settled though they go on.
            tables: of pairs of both.
            height: of a person in ground units.
        """
        count = len(episodes) + len(past)
        evidence = Evidence(episodes, past, tables, self._calibrated, self._settings, height, self._pace)
        looks = self._looks(episodes, past, tables)
        links = Links.found(evidence, looks, self._weights, len(episodes), count)
        gone = np.concatenate([np.zeros(len(episodes), dtype=np.bool_), ~here])
        group = np.arange(count)
        for batch in batches(links, evidence, looks):
            label = cluster(
                batch.evidence,
                batch.apart,
                gone[batch.rows],
                batch.linked,
                batch.looks,
                self._weights,
                self._settings.merge_threshold,
            )
            group[batch.rows] = batch.rows[label]
        return group

    def _looks(
        self, episodes: Sequence[Episode], past: Sequence[Person], tables: PairTables
    ) -> list[CameraLooks]:
        """Collect how everybody looks, camera by camera."""
        by_camera: dict[str, list[tuple[int, Look]]] = {camera: [] for camera in self._calibrated}
        open_rows: dict[str, list[int]] = {camera: [] for camera in self._calibrated}
        for row, episode in enumerate(episodes):
            open_rows[episode.key.camera].append(row)
        for row, looks in enumerate([it.looks for it in episodes] + [it.looks for it in past]):
            for name, look in looks.by_camera.items():
                by_camera[name].append((row, look))
        found = []
        for camera, seen in by_camera.items():
            alike = comparable(seen, len(episodes))
            if len(alike) > 1:
                rows = np.array([row for row, _ in alike], dtype=np.int64)
                total = np.array([look.total for _, look in alike])
                count = np.array([look.count for _, look in alike], dtype=np.float64)
                scale = self._scales.of(camera, open_rows[camera], episodes, tables)
                found.append(CameraLooks(rows, total, count, scale))
        return found

    def remember(self, old: Collection[int], episodes: Sequence[Episode], tables: PairTables) -> None:
        """Keep what episodes that are about to be settled teach about looks, by their rows."""
        self._scales.remember(old, episodes, tables)


def comparable(looks: Sequence[tuple[int, Look]], there: int) -> list[tuple[int, Look]]:
    """Give those of rows' looks with as many bins as the newest: of rows below `there`, if any."""
    newest = [look for row, look in looks if row < there] or [look for _, look in looks]
    return [(row, look) for row, look in looks if look.total.size == newest[-1].total.size]
