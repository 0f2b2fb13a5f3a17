"""A quick first guess at the duals, so that few arcs need enter the program later.

Subgradient ascent of the bound: prices of conflict rows push the cheapest paths apart, forces between
pairs of objects pull them into step. It proves nothing that counts; the search that starts from it does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.network import Network
from tracking.solvers.conflict_finder import ConflictFinder, ConflictRow
from tracking.solvers.layout_forces import LayoutForces, with_pulls
from tracking.solvers.objective import Ints
from tracking.solvers.packed import Packed
from tracking.solvers.pricing import Pricing
from tracking.solvers.row_prices import RowPrices
from tracking.solvers.viterbi import Marginals, best_paths

_STEPS = 30
_KEPT = 8
"""Of the last paths met: they are near those of the optimum."""

_FIRST, _SHORTER = 0.2, 0.94
"""Length of the first step, of the largest force or of a typical price; and of each to the one before."""

_STATES, _STATES_BY_CONFLICTS = 30, 10
"""States of a frame and object that the guess looks at, the cheapest without prices; with layout term,
or where only conflicts move objects off their cheapest paths.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """What the ascent came to.

    Attributes:
        rows: the conflict rows that cost, or that paths broke.
        prices: (R,) what going through them costs.
        pulls: (n, M - 1, 4) what a move by a pixel earns.
        paths: (G, n, M) the last paths met, of all objects at a time.
    """

    rows: list[ConflictRow]
    prices: Floats
    pulls: Floats
    paths: Ints


def guessed(network: Network, pricing: Pricing, finder: ConflictFinder, attained: float) -> Guess:
    """Guess the duals of a network; `attained` is the cost of some states without conflicts."""
    passes = Marginals.of(pricing.trellis, pricing.ahead)
    packed = Packed.cheapest(passes.through, _STATES if network.layout else _STATES_BY_CONFLICTS)
    trellis = packed.trellis(pricing.trellis)
    forces, prices = LayoutForces(network), RowPrices(packed)
    where = packed.states(network.locations[network.sets], 0.0) if network.layout else None
    each, frames = np.indices((network.objects, network.frames))
    best, best_prices, best_pulls = -np.inf, prices.prices, forces.pulls()
    met: list[Ints] = []
    for step in range(_STEPS):
        node, pulls = prices.on(trellis.node), forces.pulls()
        paths = best_paths(trellis.with_node(node if where is None else with_pulls(node, where, pulls)))
        met = [*met, packed.named(paths.nodes)][-_KEPT:]
        bound = float(paths.costs.sum() - prices.prices.sum())
        if bound > best:
            best, best_prices, best_pulls = bound, prices.prices, pulls
        usage = np.zeros(network.node.shape)
        usage[each, frames, met[-1]] = 1.0
        prices.join(finder.broken(usage))
        typical = (attained - float(passes.least.sum())) / max(1, len(prices.rows))
        length = _FIRST * _SHORTER**step
        moved = prices.climb(paths.nodes, length * typical)
        if where is not None:
            moved |= forces.climb(where[each, frames, paths.nodes], length)
        if not moved:
            break
    late = np.zeros(len(prices.prices) - len(best_prices))
    return Guess(prices.rows, np.concatenate([best_prices, late]), best_pulls, np.array(met))
