"""Looks between cameras that have no ground in common: all tracks of two cameras at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import PairTables
from bestview.association.appearance.equalized_histograms import KNOWN_PAIRS, POINTS, Appearances, distances
from bestview.association.appearance.mean_histograms import Look
from bestview.association.appearance.similarity import appearance_scores
from bestview.association.keys import EpisodeKey
from bestview.association.settings import IdentitySettings
from bestview.association.tracklet import Episode

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SETTLED_FRAMES = 20
"""Frames after which a mean histogram is more the person's than the moment's."""


class LooksBetween:
    """Gathers what looks say about tracks of cameras without a common ground.

    Learns on the way how each camera renders people, and how much people differ.

    Args:
        settings: of identity.
        calibrated: by camera; two that are have the ground to compare by.
    """

    def __init__(self, settings: IdentitySettings, calibrated: Mapping[str, bool]) -> None:
        self._settings, self._calibrated = settings, calibrated
        self.appearances = Appearances()
        self._learned: set[EpisodeKey] = set()

    @property
    def gate(self) -> float:
        """Distance below which two looks are likely one person's."""
        return self.appearances.gate(self._settings.appearance_gate, self._settings.appearance_gate_share)

    def share_ground(self, one: Iterable[str], two: Iterable[str]) -> bool:
        """Say whether two of these cameras have a common ground."""
        return any(self._calibrated[camera] for camera in one) and any(
            self._calibrated[camera] for camera in two
        )

    def update(self, episodes: Sequence[Episode], rows: Ints, tables: PairTables) -> None:
        """Compare the episodes that an update has seen.

        Args:
            episodes: all open ones.
            rows: (P,) which of them the update has seen.
            tables: what is known of their pairs; this is added to it.
        """
        self._learned &= {episode.key for episode in episodes}
        present = sorted(rows.tolist(), key=lambda row: episodes[row].key)
        names = [episodes[row].key.camera for row in present]
        starts = [i for i, name in enumerate(names) if i == 0 or names[i - 1] != name]
        cameras = [slice(start, end) for start, end in pairwise([*starts, len(names)])]
        curves = self._curves([episodes[row] for row in present], cameras)
        row_of = np.array(present, dtype=np.int64)

        def unlike(one: slice, two: slice) -> Floats:
            return distances(curves[one][:, None], curves[two][None, :])

        # Who was seen side by side, back from the last camera to what is remembered of it.
        apart: list[Floats] = []
        for camera in reversed(cameras):
            if sum(one.size for one in apart) < KNOWN_PAIRS:
                within = unlike(camera, camera)
                i, j = np.nonzero(np.triu(~np.isnan(within), 1))
                rivals = tables.apart(row_of[camera][i], row_of[camera][j])
                apart.append(within[i[rivals], j[rivals]])
        self.appearances.learn_different(np.concatenate([np.zeros(0), *reversed(apart)]))
        scores = appearance_scores(
            cameras, [self._calibrated[names[camera.start]] for camera in cameras], unlike, self.gate
        )
        one, two = row_of[scores.one], row_of[scores.two]
        tables.add_alike(one, two, scores.score)

    def _curves(self, episodes: Sequence[Episode], cameras: Sequence[slice]) -> Floats:
        """Equalised cumulative histograms (P, 33), NaN where a look is not settled yet."""
        curves = np.full((len(episodes), POINTS), np.nan)
        for camera in cameras:
            for episode in episodes[camera]:
                look = _settled(episode)
                # Once per episode: somebody who stands about must not weigh more than who walks through.
                if look is not None and episode.key not in self._learned:
                    self._learned.add(episode.key)
                    self.appearances.learn(episode.key.camera, look.mean)
            bins: dict[int, list[int]] = {}
            for at in range(camera.start, camera.stop):
                look = _settled(episodes[at])
                if look is not None:
                    bins.setdefault(look.total.size, []).append(at)
            for rows in bins.values():
                means = np.array([episodes[at].looks.by_camera[episodes[at].key.camera].mean for at in rows])
                curves[rows] = self.appearances.equalised(episodes[camera.start].key.camera, means)
        return curves


def _settled(episode: Episode) -> Look | None:
    look = episode.looks.by_camera.get(episode.key.camera)
    return look if look is not None and look.count >= _SETTLED_FRAMES else None
