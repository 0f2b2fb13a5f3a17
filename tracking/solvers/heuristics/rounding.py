"""Rounding of the relaxation to integer states (paper II.D)."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.objective import Ints

_ZERO_TOLERANCE = 1e-9
"""Flow below which a node is on no path."""

INTEGRALITY_TOLERANCE = 1e-6
"""Distance from 0 or 1 up to which y is integral: well above the solver's feasibility tolerance."""


def is_integral(usage: Floats) -> bool:
    """Return whether all of y are 0 or 1."""
    return bool((np.minimum(usage, 1.0 - usage) <= INTEGRALITY_TOLERANCE).all())


def round_relaxation(network: Network, usage: Floats) -> Ints:
    """Round y = `usage` (n, M, S) to nodes (n, M) without conflicts.

    In each frame the largest y becomes 1, its conflicting nodes and the other nodes of its object 0;
    then the next largest. Ties go to the lowest object and state. An object without a node is
    occluded.
    """
    exclusions = network.exclusions()
    nodes = np.full((network.objects, network.frames), network.max_places, dtype=np.int64)
    integral = usage.max(axis=2, initial=0.0) >= 1.0 - INTEGRALITY_TOLERANCE
    for m in range(network.frames):
        if integral[:, m].all():
            nodes[:, m] = usage[:, m].argmax(axis=1)
        else:
            nodes[:, m] = _round_frame(network, usage[:, m].copy(), exclusions[m])
    return nodes


def _round_frame(network: Network, usage: Floats, exclusions: Bools) -> Ints:
    places, sets = network.max_places, network.sets
    nodes = np.full(network.objects, places, dtype=np.int64)
    for _ in range(network.objects):
        owner, state = divmod(int(usage.argmax()), places + 1)
        if usage[owner, state] <= _ZERO_TOLERANCE:
            break
        nodes[owner] = state
        if state < places:
            excluded = exclusions[sets[owner] * places + state].reshape(-1, places)
            usage[:, :places][np.broadcast_to(excluded, (len(usage), places))] = 0.0
        usage[owner] = 0.0
    return nodes
