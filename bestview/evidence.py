"""What is known about pairs of tracks: accumulated evidence, and who was seen side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_STEPS = 2.0**20
"""Steps per unit of evidence."""


@dataclass(frozen=True, slots=True, order=True)
class TrackKey:
    """A camera's own track: what is one person for that camera."""

    camera: str
    local: int


class PairEvidence:
    """Two square tables over the tracks in play; both follow when tracks come and go.

    Attributes:
        keys: the tracks, sorted: rows and columns of the tables.
        evidence: (T, T) float64, for (above 0) and against being the same person.
        rivals: (T, T) bool, once seen at the same time in the same camera.
    """

    def __init__(self) -> None:
        self.keys: tuple[TrackKey, ...] = ()
        self.evidence: NDArray[np.float64] = np.zeros((0, 0))
        self.rivals: NDArray[np.bool_] = np.zeros((0, 0), dtype=bool)

    def follow(self, keys: Sequence[TrackKey]) -> None:
        """Make the tables those of `keys` (sorted): known pairs keep what is known, new ones start at 0."""
        place = {key: i for i, key in enumerate(self.keys)}
        new = np.array([i for i, key in enumerate(keys) if key in place], dtype=np.int64)
        old = np.array([place[key] for key in keys if key in place], dtype=np.int64)
        evidence = np.zeros((len(keys), len(keys)))
        rivals = np.zeros((len(keys), len(keys)), dtype=bool)
        evidence[np.ix_(new, new)] = self.evidence[np.ix_(old, old)]
        rivals[np.ix_(new, new)] = self.rivals[np.ix_(old, old)]
        self.keys, self.evidence, self.rivals = tuple(keys), evidence, rivals

    def places(self, keys: Sequence[TrackKey]) -> NDArray[np.int64]:
        """Find the rows of `keys`, all of which are in the tables."""
        place = {key: i for i, key in enumerate(self.keys)}
        return np.array([place[key] for key in keys], dtype=np.int64)

    def add(
        self,
        keys: Sequence[TrackKey],
        scores: NDArray[np.float64],
        side_by_side: NDArray[np.bool_],
        memory: float,
        cap: float,
    ) -> None:
        """Count one update about `keys`, (T, T) each: `scores`, NaN where nothing was learned; rivals."""
        where = np.ix_(self.places(keys), self.places(keys))
        before = self.evidence[where]
        counted = _exact(np.clip(memory * before + np.nan_to_num(scores), -cap, cap))
        self.evidence[where] = np.where(np.isnan(scores), before, counted)
        self.rivals[where] |= side_by_side

    def inherit(self, heir: TrackKey, lost: TrackKey, evidence: float) -> None:
        """Set what speaks for two tracks of one camera, one after the other, being the same person."""
        i, j = self.places([heir, lost])
        if not self.rivals[i, j]:
            self.evidence[i, j] = self.evidence[j, i] = _exact(np.float64(evidence))


def _exact(evidence: NDArray[np.float64] | np.float64) -> NDArray[np.float64]:
    """Round to steps so coarse that sums of evidence are exact: a BLAS may add in any order then."""
    return np.asarray(np.round(evidence * _STEPS) / _STEPS)
