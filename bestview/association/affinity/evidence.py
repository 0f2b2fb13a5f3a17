"""Pairwise evidence from ground, continuity, cross-camera appearance and published ids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import AffinityMatrix
from bestview.association.affinity.continuity import (
    EndpointArrays,
    continuation_evidence,
    reappearance_evidence,
)
from bestview.association.affinity.pair_table import SparsePairTable
from bestview.association.index_ranges import pairs_of_equal_label, sorted_unique
from bestview.association.registry.person import Person
from bestview.association.settings import ResolvedIdentitySettings
from bestview.association.tracklet import Tracklet

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class PairEvidence:
    """Evidence about N rows: the active tracklets, then the known people.

    Args:
        tracklets: active ones.
        people: known people with settled tracklets.
        affinity: evidence summed up so far.
        calibrated: by camera, whether it has a homography.
        settings: of identity.
        height: of a person in ground units.
        walking_speed: largest distance walked in a frame, person heights.
    """

    def __init__(
        self,
        tracklets: Sequence[Tracklet],
        people: Sequence[Person],
        affinity: AffinityMatrix,
        calibrated: Mapping[str, bool],
        settings: ResolvedIdentitySettings,
        height: float,
        walking_speed: float,
    ) -> None:
        self._affinity, self._settings, self._height, self._walking_speed = (
            affinity,
            settings,
            height,
            walking_speed,
        )
        number_of = {camera: i for i, camera in enumerate(calibrated)}
        self._camera = np.array([number_of[tracklet.key.camera] for tracklet in tracklets], dtype=np.int64)
        ground = np.array([calibrated[tracklet.key.camera] for tracklet in tracklets], dtype=np.bool_)
        self._endpoints = EndpointArrays.of(tracklets, self._camera, ground)
        self._published_id = np.array(
            [tracklet.main_id for tracklet in tracklets] + [person.person_id for person in people],
            dtype=np.int64,
        )
        self._continuation = self._continuations(tracklets, people)

    def _continuations(self, tracklets: Sequence[Tracklet], people: Sequence[Person]) -> SparsePairTable:
        """Compute the continuation evidence between tracklets and their predecessors."""
        row_of = {id(tracklet): row for row, tracklet in enumerate(tracklets)}
        row_of_person = {person.person_id: len(tracklets) + i for i, person in enumerate(people)}
        evidence: dict[tuple[int, int], float] = {}
        for row, tracklet in enumerate(tracklets):
            predecessor = tracklet.predecessor
            if predecessor is None:
                continue
            other = row_of.get(id(predecessor), row_of_person.get(predecessor.main_id, -1))
            if other >= 0:
                evidence[row, other] = continuation_evidence(tracklet, self._settings)
        table = SparsePairTable()
        pairs = np.array(list(evidence), dtype=np.int64).reshape(-1, 2)
        table.set(pairs[:, 0], pairs[:, 1], np.array(list(evidence.values()), dtype=np.float64)[:, None])
        return table

    def positive_pairs(self) -> tuple[Ints, Ints]:
        """Return the pairs of rows with some positive evidence: (P,) and (P,), each once.

        The lower row comes first and is an active tracklet.
        """
        same_camera = pairs_of_equal_label(self._camera)
        reappeared, _ = reappearance_evidence(
            self._endpoints, *same_camera, self._settings, self._height, self._walking_speed
        )
        first, second = self._affinity.proximity_pairs()
        near = self._affinity.ground_evidence(first, second) > 0
        alike = self._affinity.appearance_pairs()
        same_published_id = pairs_of_equal_label(np.where(self._published_id > 0, self._published_id, -1))
        sources = [
            (same_camera[0][reappeared > 0], same_camera[1][reappeared > 0]),
            (first[near], second[near]),
            tuple(side[self._affinity.appearance_evidence(*alike) > 0] for side in alike),
            same_published_id,
            (self._continuation.first, self._continuation.second),
        ]
        size = self._published_id.size
        pairs = sorted_unique(
            np.concatenate([first_rows * size + second_rows for first_rows, second_rows in sources])
        )
        pairs = pairs[pairs < self._camera.size * size]
        return pairs // max(size, 1), pairs % max(size, 1)

    def of(self, first: Ints, second: Ints) -> tuple[Floats, Bools]:
        """Return the evidence of (P,) pairs of rows, lower first, and whether they cannot be linked."""
        count = self._camera.size
        temporal, too_far = np.zeros(first.size), np.zeros(first.size, dtype=np.bool_)
        both = np.flatnonzero(second < count)
        temporal[both], too_far[both] = reappearance_evidence(
            self._endpoints, first[both], second[both], self._settings, self._height, self._walking_speed
        )
        follows = self._continuation.find(first, second)
        continued = follows >= 0
        # A continued track is stronger evidence than its distance.
        temporal[continued] = self._continuation.values[follows[continued], 0]
        too_far[continued] = False
        same_published_id = (self._published_id[first] == self._published_id[second]) & (
            self._published_id[first] > 0
        )
        ground, appearance = (
            self._affinity.ground_evidence(first, second),
            self._affinity.appearance_evidence(first, second),
        )
        evidence = temporal + (
            ground + appearance + self._settings.id_persistence_evidence * same_published_id
        )
        return evidence, self._affinity.cannot_link(first, second) | too_far
