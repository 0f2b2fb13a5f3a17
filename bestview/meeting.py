"""Scores by ground of one update: only of pairs of tracks that it can say something new about."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.evidence import PairEvidence
from bestview.likeness import GATES_TO_WORST, Scores, ground_scores
from bestview.reach import within_reach
from bestview.sightings import Sightings


def near_or_known(
    seen: Sightings,
    on_ground: NDArray[np.bool_],
    rows: NDArray[np.int64],
    pairs: PairEvidence,
    gate: float,
) -> Scores:
    """Score the pairs of tracks of two cameras that stand near each other, and those that have an entry.

    All others are strangers, and far apart.

    Args:
        seen: S tracks.
        on_ground: (S,) those to compare.
        rows: (S,) theirs in `pairs`.
        pairs: what is known so far.
        gate: see `Sightings.distances`.
    """
    count, here = len(seen.keys), np.flatnonzero(on_ground)
    seen_row = np.full(len(pairs.keys), -1)
    seen_row[rows[here]] = here
    known = seen_row[np.stack([pairs.one, pairs.two])]
    known = known[:, (known >= 0).all(axis=0)]
    near = here[np.stack(within_reach(seen.ground[here], seen.spread[here], gate, GATES_TO_WORST))]
    both = np.concatenate([known, near], axis=1)
    one, two = np.divmod(np.unique(both[0] * count + both[1]), max(count, 1))
    other = pairs.camera[rows[one]] != pairs.camera[rows[two]]
    one, two = one[other], two[other]
    score = ground_scores(seen.distances(one, two, gate))
    learned = ~np.isnan(score)
    return Scores(one[learned], two[learned], score[learned])
