"""From the relaxation to whole states: the rounding of paper II.D."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats
from tracking.conflicts import Bools
from tracking.network import Network
from tracking.solvers.objective import Ints

_NOTHING = 1e-9
"""A node with less than this on it is not on any path."""

INTEGRAL = 1e-6
"""Nodes within this of 0 or 1 are whole: well above the solver's feasibility tolerance."""


def is_integral(usage: Floats) -> bool:
    """Say whether all of y are 0 or 1."""
    return bool((np.minimum(usage, 1.0 - usage) <= INTEGRAL).all())


def rounded(network: Network, usage: Floats) -> Ints:
    """Round y = `usage` (n, M, S) to nodes (n, M) without conflicts.

    In each frame the largest y becomes 1, its conflicting nodes and the other nodes of its object 0;
    then the next largest. Of equal ones the lowest object and state come first. An object that keeps
    nothing is occluded.
    """
    exclusions = network.exclusions()
    nodes = np.full((network.objects, network.frames), network.places, dtype=np.int64)
    whole = usage.max(axis=2, initial=0.0) >= 1.0 - INTEGRAL
    for m in range(network.frames):
        if whole[:, m].all():
            nodes[:, m] = usage[:, m].argmax(axis=1)
        else:
            nodes[:, m] = _round_frame(network, usage[:, m].copy(), exclusions[m])
    return nodes


def _round_frame(network: Network, usage: Floats, exclusions: Bools) -> Ints:
    places, sets = network.places, network.sets
    nodes = np.full(network.objects, places, dtype=np.int64)
    for _ in range(network.objects):
        owner, state = divmod(int(usage.argmax()), places + 1)
        if usage[owner, state] <= _NOTHING:
            break
        nodes[owner] = state
        if state < places:
            barred = exclusions[sets[owner] * places + state].reshape(-1, places)
            usage[:, :places][np.broadcast_to(barred, (len(usage), places))] = 0.0
        usage[owner] = 0.0
    return nodes
