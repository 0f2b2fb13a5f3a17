"""What distances between looks mean in each camera, learned from who is surely one or surely two."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.episodes import Episode
from bestview.likelihood import LookScale, look_distances
from bestview.looks import Look

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
        self._own: dict[str, deque[float]] = {}
        self._others: dict[str, deque[float]] = {}

    def of(self, camera: str, episodes: Sequence[Episode], apart: NDArray[np.bool_]) -> LookScale:
        """Give the scale of a camera, with what the open episodes teach.

        Args:
            camera: its name.
            episodes: N of all cameras.
            apart: (N, N) seen at once.
        """
        own, others = self._distances(camera, episodes, apart, range(len(episodes)))
        return LookScale.learned(
            np.array([*self._own.get(camera, ()), *own]), np.array([*self._others.get(camera, ()), *others])
        )

    def remember(self, old: Collection[int], episodes: Sequence[Episode], apart: NDArray[np.bool_]) -> None:
        """Keep what episodes that are about to be settled teach, by their rows among all open ones."""
        for camera in sorted({episodes[row].key.camera for row in old}):
            own, others = self._distances(camera, episodes, apart, old)
            self._own.setdefault(camera, deque(maxlen=_REMEMBERED)).extend(own)
            self._others.setdefault(camera, deque(maxlen=_REMEMBERED)).extend(others)

    def _distances(
        self, camera: str, episodes: Sequence[Episode], apart: NDArray[np.bool_], of: Collection[int]
    ) -> tuple[list[float], list[float]]:
        """Distances of some episodes to the one before each, and to all that are apart from them."""
        looks = {row: look for row, it in enumerate(episodes) if (look := self._look(it, camera)) is not None}
        if not looks:
            return [], []
        bins = next(reversed(looks.values())).total.size
        rows = [row for row, look in looks.items() if look.total.size == bins]
        place = {id(episodes[row]): i for i, row in enumerate(rows)}
        mean = np.array([looks[row].mean for row in rows])
        distance = look_distances(mean, mean)
        mine = np.isin(rows, list(of))
        pairs = np.triu(apart[np.ix_(rows, rows)], 1) & (mine[:, None] | mine)
        own = []
        for i in np.flatnonzero(mine).tolist():
            episode = episodes[rows[i]]
            if episode.before is not None and id(episode.before) in place and episode.gap <= _UNBROKEN:
                own.append(float(distance[i, place[id(episode.before)]]))
        return own, distance[pairs].tolist()

    def _look(self, episode: Episode, camera: str) -> Look | None:
        look = episode.looks.by_camera.get(camera)
        return look if look is not None and look.count >= self._frames else None
