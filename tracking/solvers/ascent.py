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


@dataclass(frozen=True, slots=True)
class _Pace:
    """How an ascent goes.

    Attributes:
        steps: how many it takes.
        shorter: the length of each as a share of the one before.
        states: how many states of a frame and object it looks at, the cheapest without prices.
        price: length of the first step of prices, as a share of a typical one.
    """

    steps: int
    shorter: float
    states: int
    price: float


_WITH_LAYOUT = _Pace(steps=30, shorter=0.94, states=40, price=1.0)
_BY_CONFLICTS = _Pace(steps=25, shorter=0.92, states=10, price=0.2)
"""The layout term leads further off the cheapest paths than conflicts do."""

_FORCE = 0.2
"""Length of the first step of forces, as a share of the largest."""

_KEPT = 8
"""Of the last paths met: they are near those of the optimum."""

_EARLY, _NOW_AND_THEN = 10, 3
"""Broken rows are looked for in each of the first steps, later in some: few are still to be found."""


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


def guessed(network: Network, pricing: Pricing, finder: ConflictFinder) -> Guess:
    """Guess the duals of a network."""
    passes = Marginals.of(pricing.trellis, pricing.ahead)
    pace = _WITH_LAYOUT if network.layout else _BY_CONFLICTS
    packed = Packed.cheapest(passes.through, pace.states)
    trellis = packed.trellis(pricing.trellis)
    forces, prices = LayoutForces(network), RowPrices(packed)
    where = packed.states(network.locations[network.sets], 0.0) if network.layout else None
    typical = _typical_price(packed.states(passes.through, np.inf), passes.least)
    each, frames = np.indices((network.objects, network.frames))
    best, best_prices, best_pulls = -np.inf, prices.prices, forces.pulls()
    met: list[Ints] = []
    for step in range(pace.steps):
        node, pulls = prices.on(trellis.node), forces.pulls()
        paths = best_paths(trellis.with_node(node if where is None else with_pulls(node, where, pulls)))
        met = [*met, packed.named(paths.nodes)][-_KEPT:]
        bound = float(paths.costs.sum() - prices.prices.sum())
        if bound > best:
            best, best_prices, best_pulls = bound, prices.prices, pulls
        if step < _EARLY or step % _NOW_AND_THEN == 0:
            usage = np.zeros(network.node.shape)
            usage[each, frames, met[-1]] = 1.0
            prices.join(finder.broken(usage))
        length = pace.shorter**step
        moved = prices.climb(paths.nodes, length * pace.price * typical)
        if where is not None:
            moved |= forces.climb(where[each, frames, paths.nodes], length * _FORCE)
        if not moved:
            break
    late = np.zeros(len(prices.prices) - len(best_prices))
    return Guess(prices.rows, np.concatenate([best_prices, late]), best_pulls, np.array(met))


def _typical_price(through: Floats, least: Floats) -> float:
    """Give what it costs on average to be in the second best state of a frame; (n, M, W) and (n,)."""
    if through.shape[2] == 1:
        return 0.0
    regret = np.partition(through, 1, axis=2)[:, :, 1] - least[:, None]
    return float(regret[np.isfinite(regret)].mean()) if np.isfinite(regret).any() else 0.0
