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
    known = _of_two_cameras(known[:, (known >= 0).all(axis=0)], pairs.camera[rows])
    near = here[np.stack(within_reach(seen.ground[here], seen.spread[here], gate, GATES_TO_WORST))]
    near = _of_two_cameras(near, pairs.camera[rows])
    # Rows keep their order from one to the other, so that the known pairs are sorted as they were.
    code, others = known[0] * count + known[1], near[0] * count + near[1]
    at = np.minimum(np.searchsorted(code, others), max(code.size - 1, 0))
    new = code[at] != others if code.size else np.ones(others.shape, dtype=np.bool_)
    one, two = np.concatenate([known, near[:, new]], axis=1)
    score = ground_scores(seen.distances(one, two, gate))
    learned = ~np.isnan(score)
    return Scores(one[learned], two[learned], score[learned])


def _of_two_cameras(pairs: NDArray[np.int64], camera: NDArray[np.int64]) -> NDArray[np.int64]:
    """Keep those of (2, P) pairs of tracks that two cameras see; `camera` is (S,)."""
    return np.asarray(pairs[:, camera[pairs[0]] != camera[pairs[1]]])
