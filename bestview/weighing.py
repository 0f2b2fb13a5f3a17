"""All that is known about who is one person, added up: for grouping everybody anew."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.clustering import cluster
from bestview.continuity import Places, goes_on, lost_and_found
from bestview.episodes import Episode
from bestview.identity_settings import IdentitySettings
from bestview.likelihood import CameraLooks, LookWeights
from bestview.look_scales import LookScales
from bestview.looks import Look
from bestview.pairs import PairTables
from bestview.persons import Person

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Weighing:
    """Groups the open episodes, and the people as they were before, into people.

    Args:
        settings: of identity.
        calibrated: by camera, whether it has a ground.
    """

    def __init__(self, settings: IdentitySettings, calibrated: Mapping[str, bool]) -> None:
        self._settings, self._calibrated = settings, calibrated
        self._camera = {camera: i for i, camera in enumerate(calibrated)}
        self._scales = LookScales(settings.look_frames)
        self._weights = LookWeights(settings.look, settings.look_cap, settings.look_frames)

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
        evidence, too_far = self._order(episodes, past, height)
        evidence += tables.near + tables.alike + self._told(episodes, past)
        return cluster(
            evidence,
            tables.apart | too_far,
            np.concatenate([np.zeros(len(episodes), dtype=np.bool_), ~here]),
            self._looks(episodes, past, tables.apart),
            self._weights,
            self._settings.join,
        )

    def _order(
        self, episodes: Sequence[Episode], past: Sequence[Person], height: float
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Evidence of what goes on, and of what is found where it was lost; and who is too far away."""
        count, size = len(episodes), len(episodes) + len(past)
        evidence, too_far = np.zeros((size, size)), np.zeros((size, size), dtype=np.bool_)
        camera = np.array([self._camera[it.key.camera] for it in episodes], dtype=np.int64)
        calibrated = np.array([self._calibrated[it.key.camera] for it in episodes], dtype=np.bool_)
        near, far = lost_and_found(Places.of(episodes, camera, calibrated), self._settings, height)
        row_of = {id(episode): row for row, episode in enumerate(episodes)}
        row_of_past = {person.number: count + i for i, person in enumerate(past)}
        for row, episode in enumerate(episodes):
            before = episode.before
            if before is None:
                continue
            other = row_of.get(id(before), row_of_past.get(before.mostly, -1))
            if other < 0:
                continue
            if other < count:
                # That the track goes on says it better than the place does.
                near[row, other] = near[other, row] = 0.0
                far[row, other] = far[other, row] = False
            worth = goes_on(episode, self._settings)
            evidence[row, other] += worth
            evidence[other, row] += worth
        evidence[:count, :count] += near
        too_far[:count, :count] = far
        return evidence, too_far

    def _told(self, episodes: Sequence[Episode], past: Sequence[Person]) -> Floats:
        """Evidence that those are one who were told to be."""
        numbers = np.array([it.mostly for it in episodes] + [it.number for it in past], dtype=np.int64)
        same = (numbers[:, None] == numbers) & (numbers > 0)
        np.fill_diagonal(same, val=False)
        return np.asarray(self._settings.told * same)

    def _looks(
        self, episodes: Sequence[Episode], past: Sequence[Person], apart: NDArray[np.bool_]
    ) -> list[CameraLooks]:
        """Collect how everybody looks, camera by camera."""
        by_camera: dict[str, list[tuple[int, Look]]] = {camera: [] for camera in self._calibrated}
        for row, looks in enumerate([it.looks for it in episodes] + [it.looks for it in past]):
            for name, look in looks.by_camera.items():
                by_camera[name].append((row, look))
        found = []
        for camera, seen in by_camera.items():
            # Looks of other bins than the newest cannot be compared with anybody's.
            alike = [(row, look) for row, look in seen if look.total.size == seen[-1][1].total.size]
            if len(alike) > 1:
                rows = np.array([row for row, _ in alike], dtype=np.int64)
                total = np.array([look.total for _, look in alike])
                count = np.array([look.count for _, look in alike], dtype=np.float64)
                found.append(CameraLooks(rows, total, count, self._scales.of(camera, episodes, apart)))
        return found

    def remember(self, old: Collection[int], episodes: Sequence[Episode], tables: PairTables) -> None:
        """Keep what episodes that are about to be settled teach about looks, by their rows."""
        self._scales.remember(old, episodes, tables.apart)
