"""What distances between looks mean in each camera, learned from who is surely one or surely two."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import PairTables
from bestview.association.appearance.likelihood import LookScale, look_distances
from bestview.association.appearance.mean_histograms import Look
from bestview.association.tracklet import Episode

Floats = NDArray[np.float64]

_UNBROKEN = 3
"""Frames unseen within which a track that goes on teaches how much one person's looks differ."""
_REMEMBERED = 500
"""Distances remembered of each kind and camera."""


class LookScales:
    """Learns from open episodes, and remembers what settled ones taught.

    Args:
        frames: alone, that a look needs to teach anything.
    """

    def __init__(self, frames: int) -> None:
        self._frames = frames
        self._own: dict[str, Floats] = {}
        self._others: dict[str, Floats] = {}

    def of(
        self, camera: str, rows: Sequence[int], episodes: Sequence[Episode], tables: PairTables
    ) -> LookScale:
        """Give the scale of a camera, with what the open episodes teach.

        Args:
            camera: its name.
            rows: of its episodes.
            episodes: of all cameras.
            tables: who of them was seen at once.
        """
        own, others = self._distances(camera, rows, episodes, tables, rows)
        return LookScale.learned(_with(self._own, camera, own), _with(self._others, camera, others))

    def remember(self, old: Collection[int], episodes: Sequence[Episode], tables: PairTables) -> None:
        """Keep what episodes that are about to be settled teach, by their rows among all open ones."""
        rows_of: dict[str, list[int]] = {episodes[row].key.camera: [] for row in old}
        for row, episode in enumerate(episodes):
            if episode.key.camera in rows_of:
                rows_of[episode.key.camera].append(row)
        for camera, rows in sorted(rows_of.items()):
            own, others = self._distances(camera, rows, episodes, tables, old)
            self._own[camera] = _with(self._own, camera, own)[-_REMEMBERED:]
            self._others[camera] = _with(self._others, camera, others)[-_REMEMBERED:]

    def _distances(
        self,
        camera: str,
        rows: Sequence[int],
        episodes: Sequence[Episode],
        tables: PairTables,
        of: Collection[int],
    ) -> tuple[Floats, Floats]:
        """Distances of some episodes to the one before each, and to all that are apart from them."""
        looks = {row: look for row in rows if (look := self._look(episodes[row], camera)) is not None}
        if not looks:
            return np.zeros(0), np.zeros(0)
        bins = next(reversed(looks.values())).total.size
        rows = [row for row, look in looks.items() if look.total.size == bins]
        place = {id(episodes[row]): i for i, row in enumerate(rows)}
        mean = np.array([looks[row].mean for row in rows])
        distance = look_distances(mean, mean)
        row_of = np.array(rows, dtype=np.int64)
        mine = np.isin(row_of, np.array(list(of), dtype=np.int64))
        own: list[float] = []
        for i in np.flatnonzero(mine).tolist():
            episode = episodes[rows[i]]
            if episode.before is not None and id(episode.before) in place and episode.gap <= _UNBROKEN:
                own.append(float(distance[i, place[id(episode.before)]]))
        one, two = np.triu_indices(len(rows), 1)
        asked = mine[one] | mine[two]
        one, two = one[asked], two[asked]
        rivals = tables.apart(row_of[one], row_of[two])
        return np.array(own, dtype=np.float64), distance[one[rivals], two[rivals]]

    def _look(self, episode: Episode, camera: str) -> Look | None:
        look = episode.looks.by_camera.get(camera)
        return look if look is not None and look.count >= self._frames else None


def _with(known: dict[str, Floats], camera: str, more: Floats) -> Floats:
    """Distances known of a camera, and more."""
    return np.concatenate([known[camera], more]) if camera in known else more
