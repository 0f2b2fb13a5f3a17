"""What is known about pairs of tracks: accumulated evidence, and who was seen side by side."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bestview.rivals import Rivals
from bestview.strangers import Strangers, counted, exact


class TrackKey(NamedTuple):
    """A camera's own track: what is one person for that camera.

    A named tuple, since thousands are hashed and compared in every update.
    """

    camera: str
    local: int


class PairEvidence:
    """Evidence about the pairs of tracks in play; it follows when tracks come and go.

    A pair has an entry only where its evidence is not what strangers' would be (`Strangers`): the tables
    grow with the pairs that have met, not with the square of the tracks.

    Args:
        worst: the score of tracks that are far apart.
        memory: share of the evidence that lives on from one update to the next.
        cap: the most evidence for or against.
        remember: frames for which updates count that say nothing but "far apart".

    Attributes:
        keys: the T tracks, sorted; others speak of them by row.
        camera: (T,) their cameras' numbers, rising.
        one: (P,) rows of the pairs with an entry, sorted by `one` and `two`.
        two: (P,) above `one`.
        value: (P,) evidence for (above 0) and against being the same person.
        rivals: tracks once seen at the same time in the same camera.
    """

    def __init__(self, worst: float, memory: float, cap: float, remember: int) -> None:
        self._worst, self._memory, self._cap = worst, memory, cap
        self._strangers = Strangers(worst, memory, cap, remember)
        self.keys: tuple[TrackKey, ...] = ()
        self.camera: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self.one: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self.two: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self.value: NDArray[np.float64] = np.zeros(0)
        self.rivals = Rivals()
        self._code: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self._row: dict[TrackKey, int] = {}

    def follow(self, keys: Sequence[TrackKey], camera: NDArray[np.int64]) -> None:
        """Go over to `keys` (sorted), of `camera` (T,): known pairs keep what is known, others begin at 0."""
        if self.keys == tuple(keys):
            return
        old_of = np.array([self._row.get(key, -1) for key in keys], dtype=np.int64)
        new = np.flatnonzero(old_of >= 0)
        old = old_of[new]
        new_of = np.full(len(self.keys), -1)
        new_of[old] = new
        self._strangers.follow(len(keys), new, old)
        self.rivals.follow(camera, new, old)
        one, two = new_of[self.one], new_of[self.two]
        self.keys, self.camera = tuple(keys), camera
        self._row = {key: row for row, key in enumerate(self.keys)}
        known = (one >= 0) & (two >= 0)
        # Both lists of keys are sorted, and so the pairs stay sorted.
        self._keep(one[known], two[known], self.value[known])

    def _keep(self, one: NDArray[np.int64], two: NDArray[np.int64], value: NDArray[np.float64]) -> None:
        self.one, self.two, self.value = one, two, value
        self._code = one * len(self.keys) + two

    def rows(self, keys: Sequence[TrackKey]) -> NDArray[np.int64]:
        """Find the rows of `keys`, all of which are in play: (K,)."""
        return np.array([self._row[key] for key in keys], dtype=np.int64)

    def in_play(self, keys: Iterable[TrackKey]) -> NDArray[np.int64]:
        """Find the rows of those of `keys` that are in play, in rising order."""
        return np.array(sorted(self._row[key] for key in keys if key in self._row), dtype=np.int64)

    def between(self, one: NDArray[np.int64], two: NDArray[np.int64]) -> NDArray[np.float64]:
        """Evidence about (P,) pairs of tracks, either first: (P,)."""
        at, known = self._find(np.minimum(one, two), np.maximum(one, two))
        evidence = np.zeros(one.shape)
        evidence[known] = self.value[at[known]]
        strange = np.flatnonzero(~known & (self.camera[one] != self.camera[two]))
        evidence[strange] = self._strangers.evidence(one[strange], two[strange])
        return evidence

    def _find(
        self, one: NDArray[np.int64], two: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Entries of pairs, the first lower: where they are or would be, and whether they are there."""
        code = one * len(self.keys) + two
        at = np.searchsorted(self._code, code)
        known = np.zeros(code.shape, dtype=np.bool_)
        inside = at < self._code.size
        known[inside] = self._code[at[inside]] == code[inside]
        return at, known

    def add(
        self,
        last_frame: int,
        one: NDArray[np.int64],
        two: NDArray[np.int64],
        score: NDArray[np.float64],
        rows: NDArray[np.int64],
        known: NDArray[np.bool_],
    ) -> None:
        """Count one update.

        Args:
            last_frame: with which it ends.
            one: (P,) rows of pairs of different cameras, each pair once: all that have an entry and all
                that are not far apart.
            two: (P,) above `one`.
            score: (P,) what is said about them.
            rows: (S,) of the tracks that are on the ground.
            known: (S, W) in which frames they are. All pairs that are not in `one` have the worst score
                if that is in enough frames for both.
        """
        at, entered = self._find(one, two)
        # Who is far apart and has no entry needs none.
        met = np.flatnonzero(entered | (score > self._worst))
        one, two, score, at, entered = one[met], two[met], score[met], at[met], entered[met]
        before = np.zeros(score.shape)
        before[entered] = self.value[at[entered]]
        before[~entered] = self._strangers.evidence(one[~entered], two[~entered])
        value = counted(before, score, self._memory, self._cap)
        self._strangers.see(last_frame, rows, known)
        self.value = self.value.copy()
        self.value[at[entered]] = value[entered]
        new = ~entered
        self._enter(one[new], two[new], value[new])
        self._drop_strangers()

    def _enter(self, one: NDArray[np.int64], two: NDArray[np.int64], value: NDArray[np.float64]) -> None:
        if one.size:
            # Insertion keeps the order of what comes to the same place.
            order = np.lexsort((two, one))
            one, two, value = one[order], two[order], value[order]
            at, _ = self._find(one, two)
            self._keep(
                np.insert(self.one, at, one), np.insert(self.two, at, two), np.insert(self.value, at, value)
            )

    def _drop_strangers(self) -> None:
        """Give up entries that say what strangers' would."""
        maybe = np.flatnonzero(np.isin(self.value, self._strangers.levels))
        one, two = self.one[maybe], self.two[maybe]
        same = self.camera[one] == self.camera[two]
        usual = np.where(same, 0.0, self._strangers.evidence(one, two))
        keep = np.ones(self.value.shape, dtype=np.bool_)
        keep[maybe] = self.value[maybe] != usual
        self._keep(self.one[keep], self.two[keep], self.value[keep])

    def inherit(
        self, heirs: NDArray[np.int64], lost: NDArray[np.int64], evidence: NDArray[np.float64]
    ) -> None:
        """Set what speaks for (H,) pairs of tracks of one camera, one after the other, being one person."""
        one, two = np.minimum(heirs, lost), np.maximum(heirs, lost)
        possible = ~self.rivals.between(one, two)
        one, two, value = one[possible], two[possible], exact(evidence[possible])
        at, known = self._find(one, two)
        self.value[at[known]] = value[known]
        self._enter(one[~known], two[~known], value[~known])
