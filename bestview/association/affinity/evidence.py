"""What is known of pairs of rows besides their looks in one camera, pair by pair."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import PairTables
from bestview.association.affinity.continuity import Places, goes_on, lost_and_found
from bestview.association.affinity.pair_table import PairTable
from bestview.association.index_ranges import distinct, pairs_within
from bestview.association.registry.person import Person
from bestview.association.settings import IdentitySettings
from bestview.association.tracklet import Episode

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class Evidence:
    """Evidence about N rows: the open episodes, then people as they were before.

    Args:
        episodes: open ones.
        past: people as they were before.
        tables: of pairs of both.
        calibrated: by camera, whether it has a ground.
        settings: of identity.
        height: of a person in ground units.
        pace: how far somebody can walk in a frame, in heights.
    """

    def __init__(
        self,
        episodes: Sequence[Episode],
        past: Sequence[Person],
        tables: PairTables,
        calibrated: Mapping[str, bool],
        settings: IdentitySettings,
        height: float,
        pace: float,
    ) -> None:
        self._tables, self._settings, self._height, self._pace = tables, settings, height, pace
        number_of = {camera: i for i, camera in enumerate(calibrated)}
        self._camera = np.array([number_of[it.key.camera] for it in episodes], dtype=np.int64)
        ground = np.array([calibrated[it.key.camera] for it in episodes], dtype=np.bool_)
        self._places = Places.of(episodes, self._camera, ground)
        self._number = np.array([it.mostly for it in episodes] + [it.number for it in past], dtype=np.int64)
        self._goes_on = self._going_on(episodes, past)

    def _going_on(self, episodes: Sequence[Episode], past: Sequence[Person]) -> PairTable:
        """Evidence that tracks go on, of episodes and what was before them."""
        row_of = {id(episode): row for row, episode in enumerate(episodes)}
        row_of_past = {person.number: len(episodes) + i for i, person in enumerate(past)}
        found: dict[tuple[int, int], float] = {}
        for row, episode in enumerate(episodes):
            before = episode.before
            if before is None:
                continue
            other = row_of.get(id(before), row_of_past.get(before.mostly, -1))
            if other >= 0:
                found[row, other] = goes_on(episode, self._settings)
        table = PairTable()
        pairs = np.array(list(found), dtype=np.int64).reshape(-1, 2)
        table.put(pairs[:, 0], pairs[:, 1], np.array(list(found.values()), dtype=np.float64)[:, None])
        return table

    def spoken_for(self) -> tuple[Ints, Ints]:
        """Give the pairs of rows for whose being one person something speaks: (P,) and (P,), each once.

        The lower row comes first, and is an open episode.
        """
        same_camera = pairs_within(self._camera)
        found, _ = lost_and_found(self._places, *same_camera, self._settings, self._height, self._pace)
        one, two = self._tables.met()
        near = self._tables.near(one, two) > 0
        alike = self._tables.all_alike()
        told = pairs_within(np.where(self._number > 0, self._number, -1))
        parts = [
            (same_camera[0][found > 0], same_camera[1][found > 0]),
            (one[near], two[near]),
            tuple(side[self._tables.alike(*alike) > 0] for side in alike),
            told,
            (self._goes_on.one, self._goes_on.two),
        ]
        size = self._number.size
        pairs = distinct(np.concatenate([a * size + b for a, b in parts]))
        pairs = pairs[pairs < self._camera.size * size]
        return pairs // max(size, 1), pairs % max(size, 1)

    def of(self, one: Ints, two: Ints) -> tuple[Floats, Bools]:
        """Give the evidence of (P,) pairs of rows, the lower row first; and whether they are surely two."""
        count = self._camera.size
        order, too_far = np.zeros(one.size), np.zeros(one.size, dtype=np.bool_)
        both = np.flatnonzero(two < count)
        order[both], too_far[both] = lost_and_found(
            self._places, one[both], two[both], self._settings, self._height, self._pace
        )
        follows = self._goes_on.find(one, two)
        goes_on_ = follows >= 0
        # That the track goes on says it better than the place does.
        order[goes_on_] = self._goes_on.value[follows[goes_on_], 0]
        too_far[goes_on_] = False
        same = (self._number[one] == self._number[two]) & (self._number[one] > 0)
        near, alike = self._tables.near(one, two), self._tables.alike(one, two)
        evidence = order + (near + alike + self._settings.id_persistence_evidence * same)
        return evidence, self._tables.apart(one, two) | too_far
