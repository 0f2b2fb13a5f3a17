"""The registry with square tables in place of sparse ones."""

from __future__ import annotations

from collections.abc import Sequence

import dense_tables as dense
import numpy as np
from numpy.typing import NDArray

from bestview import IdentityRegistry, Merge
from bestview.sightings import Sightings
from bestview.succession import Place


class DenseRegistry(IdentityRegistry):
    """Same updates in, same numbers out; the square of the tracks is the cost."""

    def _gather(self, seen: Sightings, present: NDArray[np.bool_], last_frame: int) -> None:
        looks = self._by_looks(seen, present)
        scores = dense.ground_scores(seen, present, self._gate())
        scores[looks.one, looks.two] = scores[looks.two, looks.one] = looks.score
        side_by_side = np.zeros(scores.shape, dtype=bool)
        for camera in seen.cameras():
            side_by_side[camera, camera] = seen.side_by_side(camera)
        pairs = self._dense()
        pairs.follow(self._people.tracks_heard_since(last_frame - self._settings.track_memory))
        pairs.add(pairs.rows(seen.keys), scores, side_by_side, self._settings.memory, self._settings.cap)

    def _dense(self) -> dense.DensePairs:
        if not isinstance(self._pairs, dense.DensePairs):
            self._pairs = dense.DensePairs()  # type: ignore[assignment]
        return self._pairs  # type: ignore[return-value]

    def _inherit(
        self, seen: Sightings, present: NDArray[np.bool_], places: Sequence[tuple[Place, Place]]
    ) -> NDArray[np.bool_]:
        pairs = self._dense()
        sighted = dict(zip((seen.keys[i] for i in np.flatnonzero(present).tolist()), places, strict=True))
        stays = present.copy()
        for heir in self._heirs.update(pairs.keys, sighted, seen.first):
            pairs.inherit(heir.heir, heir.lost, self._settings.heir * heir.score)
            if heir.lost in sighted:
                stays[seen.keys.index(heir.lost)] = False
        return stays

    def _regroup(self, seen: Sightings, present: NDArray[np.bool_]) -> tuple[Merge, ...]:
        pairs = self._dense()
        here = np.zeros(len(pairs.keys), dtype=bool)
        here[pairs.rows(seen.keys)] = present
        if not here.any():
            return ()
        problem = dense.DenseProblem(
            evidence=pairs.evidence,
            rivals=pairs.rivals.table,
            camera=np.array([self._camera[key.camera] for key in pairs.keys], dtype=np.int64),
            person=self._people.serials(pairs.keys),
            present=here,
            hold=np.array([self._people.hold(key) for key in pairs.keys]),
            join=self._settings.join,
        )
        return self._people.regroup(self._pairs, dense.group(problem), here)
