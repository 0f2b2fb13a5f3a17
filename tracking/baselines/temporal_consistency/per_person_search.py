"""The cheapest joint path, person by person within a stage: exact, and much less work than edge by edge.

    V_t(b_1 .. b_k) = a M + min over b' of ( V_(t-1)(b'_1 .. b'_k) + sum over p of c_p(b'_p, b_p) )

The costs of a step are a sum over people, so the minimum over all of the earlier nodes is taken over one
person's blob after the other: k b^(k+1) sums a stage instead of the b^(2k) of section 2.2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tracking.baselines.temporal_consistency.graph import Indices, Links, merge_costs
from tracking.boxes import Floats


def cheapest_joint_path(
    links: Sequence[Sequence[Links]],
    shared: Sequence[NDArray[np.bool_]],
    taken: Sequence[NDArray[np.int64]],
    merge: float,
) -> tuple[Indices, float]:
    """Find the best path of k people through T stages.

    Args:
        links: of each of them, stage by stage.
        shared: T rows `(B,)`, where it costs something to be several.
        taken: T rows `(B,)`, how many others are there whatever happens.
        merge: M.

    Returns:
        `(T, k)` blobs, the lowest of equally good ones, and the path's cost, infinite if there is none.
    """
    value = np.zeros((1,) * len(links))
    trace: list[list[Indices]] = []
    stages = list(zip(*links, strict=True))
    for stage, free, others in zip(stages, shared, taken, strict=True):
        chosen = []
        for person, mine in enumerate(stage):
            value, best = _step(value, person, mine.costs)
            chosen.append(best)
        value = value + merge_costs([it.blobs for it in stage], free, others, merge)
        trace.append(chosen)
    at = [int(it) for it in np.unravel_index(int(value.argmin()), value.shape)]
    cost = float(value[tuple(at)])
    path = np.empty((len(stages), len(links)), dtype=np.int64)
    for row in range(len(stages) - 1, -1, -1):
        path[row] = [mine.blobs[place] for mine, place in zip(stages[row], at, strict=True)]
        # The last person's minimum was taken over nodes in which the others had their new blobs already.
        for person in range(len(links) - 1, -1, -1):
            at[person] = int(trace[row][person][tuple(at)])
    return path, cost


def _step(value: Floats, axis: int, costs: Floats) -> tuple[Floats, Indices]:
    """Move one person: replace the axis of their old blob, r' long, by that of the new one, r long."""
    sums = np.moveaxis(value, axis, -1)[..., None] + costs
    best = sums.argmin(axis=-2)
    least = np.take_along_axis(sums, best[..., None, :], axis=-2)[..., 0, :]
    return np.moveaxis(least, -1, axis), np.moveaxis(best, -1, axis)
