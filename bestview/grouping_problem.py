"""What is to be grouped into persons, and which tracks speak for each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.evidence import PairEvidence


@dataclass(frozen=True, slots=True)
class GroupingProblem:
    """T tracks, each with a camera and a person so far, and what is known about pairs of them.

    Attributes:
        pairs: evidence for being the same person, within a camera only between a lost track and its
            heir; and who was seen at the same time in one camera.
        person: (T,) person so far, any integers >= 0.
        present: (T,) bool, seen just now: only these move, and only these speak.
        hold: (T,) evidence against that it takes to part the track from its person.
        join: evidence that lets a track join a person, above 0.
    """

    pairs: PairEvidence
    person: NDArray[np.int64]
    present: NDArray[np.bool_]
    hold: NDArray[np.float64]
    join: float

    @property
    def camera(self) -> NDArray[np.int64]:
        """(T,) camera index, rising."""
        return self.pairs.camera


@dataclass(frozen=True, slots=True)
class Links:
    """Pairs of tracks with evidence for being one person, each both ways round: N of them.

    Attributes:
        track: (N,) rising.
        other: (N,).
        start: (T + 1,) where each track's begin.
    """

    track: NDArray[np.int64]
    other: NDArray[np.int64]
    start: NDArray[np.int64]

    @classmethod
    def of(cls, pairs: PairEvidence) -> Links:
        """Find them."""
        speaks = pairs.value > 0
        one, two = pairs.one[speaks], pairs.two[speaks]
        track, other = np.concatenate([one, two]), np.concatenate([two, one])
        order = np.lexsort((other, track))
        track = track[order]
        start = np.searchsorted(track, np.arange(len(pairs.keys) + 1))
        return cls(track, other[order], start.astype(np.int64))
