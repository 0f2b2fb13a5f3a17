"""Swap margins: the additional cost of a window with two identities exchanged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.base import OCCLUDED
from tracking.solvers.objective import nodes_from_states


@dataclass(frozen=True, slots=True, eq=False)
class CheapestSwaps:
    """The cheapest identity swap of each pair of objects of a window.

    Attributes:
        margins: (n, n) symmetric, cost above the solution's; infinite where arcs are missing, and on the
            diagonal. Negative only if the solution was not optimal.
        frames: (n, n) index of the first frame of the window after the swap.
    """

    margins: Floats
    frames: NDArray[np.int64]


def swap_margin_matrix(network: Network, states: NDArray[np.int64]) -> Floats:
    """Return the margins of `find_cheapest_swaps`, (n, n)."""
    return find_cheapest_swaps(network, states).margins


def find_cheapest_swaps(network: Network, states: NDArray[np.int64]) -> CheapestSwaps:
    """Compute the cost of swapping each pair of objects from each frame on, and the cheapest frame.

    From frame f on, a follows b's path and b follows a's; the others are unchanged, so no new conflicts
    arise. The cost of a's new path is the head of its path, one connecting arc, and b's tail at a's costs:
    cumulative sums from both ends, O(n² M). The minimum over f is exact for paths through these nodes; the
    layout term is not included. From f on at least one of the two must be visible.

    Args:
        network: a network whose objects share their observations.
        states: (n, M) the solution, -1 where occluded.

    Raises:
        ValueError: the objects do not share their observations.
    """
    if not network.shared:
        raise ValueError("identities can only be swapped between objects that share observations")
    n = network.objects
    if not n:
        return CheapestSwaps(np.empty((0, 0)), np.empty((0, 0), dtype=np.int64))
    path_costs, swapped = _path_costs(network, nodes_from_states(network, states))
    both = swapped + swapped.transpose(1, 0, 2)
    # A swap of two objects that stay occluded to the end has no visible effect.
    visible = (states != OCCLUDED)[:, ::-1].cumsum(axis=1)[:, ::-1] > 0
    both[~(visible[:, None] | visible[None])] = np.inf
    frames = both.argmin(axis=2)
    # A rounded solution may contain a gated arc: its object has no margin.
    cheapest, current = both.min(axis=2), path_costs[:, None] + path_costs[None]
    margins = np.subtract(cheapest, current, out=np.full((n, n), np.inf), where=np.isfinite(current))
    np.fill_diagonal(margins, np.inf)
    return CheapestSwaps(margins, frames)


def _path_costs(network: Network, nodes: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return the costs of the paths, (n,), and of a's path with b's tail from each frame on, (n, n, M)."""
    frames, sets = np.arange(network.frames), network.pair_sets
    n = len(nodes)
    # Costs of b's path (second axis) for object a (first axis).
    visits = network.node[:, frames, nodes]
    arcs = network.pair[:, frames[:-1], nodes[:, :-1], nodes[:, 1:]][sets]
    connecting = network.pair[sets[:, None, None], frames[:-1], nodes[:, None, :-1], nodes[None, :, 1:]]
    begins, ends = network.source[:, nodes[:, 0]], network.sink[:, nodes[:, -1]]
    tails = visits.copy()
    tails[:, :, :-1] += arcs
    tails[:, :, -1] += ends
    tails = tails[:, :, ::-1].cumsum(axis=2)[:, :, ::-1]
    diagonal = np.arange(n)
    steps = visits[diagonal, diagonal].copy()
    steps[:, 0] += begins[diagonal, diagonal]
    steps[:, 1:] += arcs[diagonal, diagonal]
    heads = steps.cumsum(axis=1)
    swapped = tails
    swapped[:, :, 1:] += heads[:, None, :-1] + connecting
    path_costs = heads[:, -1] + ends[diagonal, diagonal]
    swapped[:, :, 0] += begins
    return path_costs, swapped
