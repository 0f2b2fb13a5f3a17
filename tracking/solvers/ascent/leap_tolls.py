"""Tolls of hiding and reappearing: what the layout term takes for them at least, whoever else does it too.

Prices of movements charge nobody for what everybody does: if all objects hide in the same step, each for a
part of its flow, they leap to the center together. But they come from boxes that do not conflict, so that
their leaps differ.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.sparse_trellis import SparseTrellis


def leap_tolls(network: Network, trellis: SparseTrellis, leap: float) -> Floats:
    """Return the toll of each arc, (E,) pixels: zero but for arcs between a box and hiding.

    Movements of a side count as far as they exceed `leap` pixels; what is below is left to the prices. Two
    objects that both hide, or both reappear, come from or go to boxes that do not conflict: each can be
    charged half of the least difference to such another leap. If the other does not leap, the whole
    difference is charged. Zero where objects do not share their observations.
    """
    tolls = np.zeros(len(trellis))
    if not network.shared or not network.max_places:
        return tolls
    movements = trellis.movements(network.locations)[0]
    beyond = movements - np.clip(movements, -leap, leap)
    exclusions = network.exclusions()
    hidden = network.max_places
    for m, step in enumerate(trellis.steps):
        hides, appears = (step.origin < hidden) & (step.target == hidden), (step.origin == hidden)
        appears &= step.target < hidden
        leaps = np.flatnonzero(hides | appears)
        if not len(leaps):
            continue
        own, hiding = beyond[step.span], hides[leaps]
        apart = cdist(own[leaps], own[leaps], "cityblock")
        for group, boxes, frame in ((hiding, step.origin[leaps], m), (~hiding, step.target[leaps], m + 1)):
            chosen = np.flatnonzero(group)
            box = boxes[chosen]
            together = exclusions[frame][np.ix_(box, box)] | (box[:, None] == box)
            apart[np.ix_(chosen, chosen)] += np.where(together, np.inf, 0.0)
        charges = np.asarray(0.5 * apart.min(axis=1))
        rest = own[~(hides | appears)]
        near = np.flatnonzero(_least_apart(own[leaps], rest) < charges)
        to_rest = cdist(own[leaps[near]], rest, "cityblock").min(axis=1, initial=np.inf)
        charges[near] = np.minimum(charges[near], to_rest)
        tolls[step.span.start + leaps] = charges
    return tolls * (network.objects - 1)


def _least_apart(movements: Floats, others: Floats) -> Floats:
    """Return a lower bound of the city-block distances of movements (A, 4) from all others (B, 4), (A,).

    Hiding boxes lose their width and height; of the boxes that stay, few change theirs.
    """
    apart = np.zeros(len(movements))
    for first, second in ((0, 2), (1, 3)):
        sizes = others[:, first] - others[:, second]
        low, high = sizes.min(initial=np.inf), sizes.max(initial=-np.inf)
        size = movements[:, first] - movements[:, second]
        apart += np.maximum(np.maximum(low - size, size - high), 0.0)
    return apart
