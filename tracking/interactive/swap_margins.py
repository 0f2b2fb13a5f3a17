"""Swap margins: how much more a window costs with two identities exchanged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.base import OCCLUDED
from tracking.solvers.objective import nodes_from_states


@dataclass(frozen=True, slots=True, eq=False)
class SwapMargins:
    """The cheapest identity swap of every two objects of a window.

    Attributes:
        margins: (n, n) symmetric, cost above the solution's; infinite where there are no arcs, and on the
            diagonal. Negative only where the solution was not optimal.
        frames: (n, n) index of the first frame of the window after the swap.
    """

    margins: Floats
    frames: NDArray[np.int64]


def swap_margin_matrix(network: Network, states: NDArray[np.int64]) -> Floats:
    """Return the margins of `swap_margins`, (n, n)."""
    return swap_margins(network, states).margins


def swap_margins(network: Network, states: NDArray[np.int64]) -> SwapMargins:
    """Compute the cost of swapping every two objects from every frame on, and the cheapest frame.

    From frame f on, a goes where b went and b where a went; everybody else stays, so nothing new conflicts.
    What a's path costs then is a head of its own path, one arc over, and b's tail at a's prices: sums
    from the front and from the back over the frames, O(n² M). The least over f is exact for paths
    through these nodes; the layout term is not in it. From f on at least one of the two must be seen.

    Args:
        network: whose objects share their observations.
        states: (n, M) the answer, -1 where hidden.

    Raises:
        ValueError: objects have observations of their own.
    """
    if not network.shared:
        raise ValueError("identities can only be swapped between objects that share observations")
    n = network.objects
    if not n:
        return SwapMargins(np.empty((0, 0)), np.empty((0, 0), dtype=np.int64))
    own, crossed = _path_costs(network, nodes_from_states(network, states))
    both = crossed + crossed.transpose(1, 0, 2)
    # A swap of two objects that stay hidden to the end changes nothing visible.
    shown = (states != OCCLUDED)[:, ::-1].cumsum(axis=1)[:, ::-1] > 0
    both[~(shown[:, None] | shown[None])] = np.inf
    frames = both.argmin(axis=2)
    # A rounded solution may hold a gated arc: its object has no margin.
    least, now = both.min(axis=2), own[:, None] + own[None]
    margins = np.subtract(least, now, out=np.full((n, n), np.inf), where=np.isfinite(now))
    np.fill_diagonal(margins, np.inf)
    return SwapMargins(margins, frames)


def _path_costs(network: Network, nodes: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return the costs of the paths, (n,), and of a's path with b's tail from each frame on, (n, n, M)."""
    frames, sets = np.arange(network.frames), network.pair_sets
    n = len(nodes)
    # All of them: what the path of b (second axis) costs at the prices of a (first axis).
    visits = network.node[:, frames, nodes]
    arcs = network.pair[:, frames[:-1], nodes[:, :-1], nodes[:, 1:]][sets]
    over = network.pair[sets[:, None, None], frames[:-1], nodes[:, None, :-1], nodes[None, :, 1:]]
    begins, ends = network.source[:, nodes[:, 0]], network.sink[:, nodes[:, -1]]
    tails = visits.copy()
    tails[:, :, :-1] += arcs
    tails[:, :, -1] += ends
    tails = tails[:, :, ::-1].cumsum(axis=2)[:, :, ::-1]
    mine = np.arange(n)
    steps = visits[mine, mine].copy()
    steps[:, 0] += begins[mine, mine]
    steps[:, 1:] += arcs[mine, mine]
    heads = steps.cumsum(axis=1)
    crossed = tails
    crossed[:, :, 1:] += heads[:, None, :-1] + over
    own = heads[:, -1] + ends[mine, mine]
    crossed[:, :, 0] += begins
    return own, crossed
