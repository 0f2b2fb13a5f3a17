"""The cheapest joint path as section 2.1 has it: node by node, along every link between two stages.

To check the quicker way by, and to measure what pruning saves.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from tracking.baselines.temporal_consistency.graph import Indices, Links, merge_costs


def cheapest_path_by_edges(
    links: Sequence[Sequence[Links]], shared: Sequence[NDArray[np.bool_]], merge: float
) -> tuple[Indices, float]:
    """Find the best path of k people through T stages; see `sweep.cheapest`, where nobody else is."""
    people = len(links)
    value = np.zeros(1)
    before = np.zeros((1, people), dtype=np.int64)
    trace: list[tuple[Indices, Indices]] = []
    for stage, free in zip(zip(*links, strict=True), shared, strict=True):
        nodes = np.array(list(product(*(range(len(it.blobs)) for it in stage))), dtype=np.int64)
        sums = value[:, None] + np.zeros(len(nodes))
        for person, mine in enumerate(stage):
            sums += mine.costs[before[:, person][:, None], nodes[:, person]]
        best = sums.argmin(axis=0)
        nobody = np.zeros(len(free), dtype=np.int64)
        merges = merge_costs([it.blobs for it in stage], free, nobody, merge).ravel()
        value = sums[best, np.arange(len(nodes))] + merges
        blobs = np.stack([mine.blobs[nodes[:, person]] for person, mine in enumerate(stage)], axis=-1)
        trace.append((blobs, best))
        before = nodes
    at = int(value.argmin())
    cost, path = float(value[at]), np.empty((len(trace), people), dtype=np.int64)
    for row in range(len(trace) - 1, -1, -1):
        blobs, best = trace[row]
        path[row], at = blobs[at], int(best[at])
    return path, cost
