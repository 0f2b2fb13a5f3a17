"""How the tracks look that have been seen for long enough: compared camera by camera, when asked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.appearance import POINTS, Appearances, distances
from bestview.people import People
from bestview.sightings import Sightings

_SETTLED_UPDATES = 10
"""Updates after which a mean histogram is more the person's than the moment's."""


class SettledLooks:
    """Mean histograms of the tracks present in an update, equalised by what each camera sees on the whole.

    Teaches `appearances` how each camera renders people.
    """

    def __init__(
        self, appearances: Appearances, people: People, seen: Sightings, present: NDArray[np.bool_]
    ) -> None:
        self._appearances, self._camera = appearances, [key.camera for key in seen.keys]
        self._looks: dict[int, NDArray[np.float64]] = {}
        self._found: dict[int, tuple[NDArray[np.int64], NDArray[np.float64]]] = {}
        for row in np.flatnonzero(present).tolist():
            key = seen.keys[row]
            person = people.person(key)
            look = person.looks.get(key.camera)
            if look is None or look.count < _SETTLED_UPDATES:
                continue
            self._looks[row] = look.total / look.count
            # Once per track: somebody who stands about must not weigh more than who walks through.
            if person.tracks.get(key, 0) == _SETTLED_UPDATES:
                appearances.learn(key.camera, self._looks[row])

    def unlike(self, one: slice, two: slice) -> NDArray[np.float64]:
        """Appearance distances between the rows of two cameras: (A, B); NaN: unknown."""
        answer = np.full((one.stop - one.start, two.stop - two.start), np.nan)
        (row, curve), (column, other) = self._curves(one), self._curves(two)
        if row.size and column.size:
            answer[row[:, None], column] = distances(curve[:, None], other)
        return answer

    def _curves(self, camera: slice) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Which rows of a camera, counted from its first, are settled, (N,), and their curves, (N, 33)."""
        if camera.start not in self._found:
            rows = [row for row in range(camera.start, camera.stop) if row in self._looks]
            curves = np.zeros((len(rows), POINTS))
            sizes = [self._looks[row].size for row in rows]
            for size in dict.fromkeys(sizes):
                alike = [i for i, mine in enumerate(sizes) if mine == size]
                looks = np.array([self._looks[rows[i]] for i in alike])
                curves[alike] = self._appearances.equalised(self._camera[camera.start], looks)
            self._found[camera.start] = np.array(rows, dtype=np.int64) - camera.start, curves
        return self._found[camera.start]
