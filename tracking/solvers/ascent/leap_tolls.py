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
        hides = np.flatnonzero((step.origin < hidden) & (step.target == hidden))
        appears = np.flatnonzero((step.origin == hidden) & (step.target < hidden))
        others = np.flatnonzero((step.origin == hidden) == (step.target == hidden))
        lengths = beyond[step.span]
        own = tolls[step.span]
        for leaps, opposite, boxes, frame in (
            (hides, appears, step.origin[hides], m),
            (appears, hides, step.target[appears], m + 1),
        ):
            if not len(leaps):
                continue
            apart = _differences(lengths[leaps], lengths[leaps])
            apart[exclusions[frame][np.ix_(boxes, boxes)] | (boxes[:, None] == boxes)] = np.inf
            to_leaps = np.minimum(apart.min(axis=1), _least(lengths[leaps], lengths[opposite]))
            own[leaps] = np.minimum(0.5 * to_leaps, _least(lengths[leaps], lengths[others]))
    return tolls * (network.objects - 1)


def _differences(first: Floats, second: Floats) -> Floats:
    """Return the city-block distances of vectors (A, 4) and (B, 4), (A, B)."""
    return np.asarray(cdist(first, second, "cityblock"))


def _least(first: Floats, second: Floats) -> Floats:
    """Return the least of these distances for each of the first, (A,); infinite if there is no second."""
    return np.asarray(_differences(first, second).min(axis=1, initial=np.inf))
