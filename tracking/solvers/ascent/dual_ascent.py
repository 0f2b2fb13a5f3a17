"""Approximate dual ascent for conflicts: a starting point for column generation over arcs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.ascent.adam import AdamSteps
from tracking.solvers.ascent.conflict_duals import ConflictDuals, typical_price
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator
from tracking.solvers.objective import Ints
from tracking.solvers.viterbi import MinMarginals, PathPricer, PrunedStates, best_paths

_STEPS, _STEP_DECAY, _FIRST_STEP = 15, 0.88, 0.2
"""Steps, the length of each over the one before, and that of the first as a share of a typical price."""

_MOMENTUM, _DECAY, _EPSILON = 0.6, 0.9, 1e-3
"""Decays of the moments of the slopes, and what is added to the typical slope."""

_STATES = 10
"""States per frame and object, the cheapest without prices."""

_KEPT_PATHS = 8
"""Number of the last paths that are kept: they are near those of the optimum."""

_SHARE = 0.3
"""Largest share of the budget: a program is solved after it."""

_EARLY_STEPS, _SEPARATION_INTERVAL = 10, 3
"""Violated rows are searched in each of the first steps, then in every few steps: later there are few."""


@dataclass(frozen=True, slots=True, eq=False)
class DualGuess:
    """Result of the ascent.

    Attributes:
        rows: the conflict rows that were violated.
        prices: (R,) their prices.
        paths: (G, n, M) the last paths of all objects.
    """

    rows: list[ConflictRow]
    prices: Floats
    paths: Ints


def guess_duals(
    network: Network, pricing: PathPricer, finder: ConflictSeparator, meter: BudgetMeter
) -> DualGuess:
    """Approximate the optimal duals of a network, with at least one step."""
    passes = MinMarginals.of(pricing.trellis, pricing.forward)
    packed = PrunedStates.cheapest(passes.through, _STATES)
    trellis = packed.trellis(pricing.trellis)
    prices = ConflictDuals(packed, AdamSteps(_MOMENTUM, _DECAY, _EPSILON))
    typical = typical_price(packed.states(passes.through, np.inf), passes.least)
    best, best_prices = -np.inf, prices.prices
    last_paths: list[Ints] = []
    for step in range(_STEPS):
        paths = best_paths(trellis.with_node(prices.add_to(trellis.node)))
        last_paths = [*last_paths, packed.original_states(paths.nodes)][-_KEPT_PATHS:]
        bound = float(paths.costs.sum() - prices.prices.sum())
        if bound > best:
            best, best_prices = bound, prices.prices
        if step < _EARLY_STEPS or step % _SEPARATION_INTERVAL == 0:
            prices.add_rows(finder.find_new_violated(usage_of_paths(network, last_paths[-1])))
        moved = prices.ascend(prices.loads_of_paths(paths.nodes), _STEP_DECAY**step * _FIRST_STEP * typical)
        meter.add_step()
        meter.add_passes(*packed.index.shape)
        if not moved or meter.reached(_SHARE):
            break
    new = np.zeros(len(prices.prices) - len(best_prices))
    return DualGuess(prices.rows, np.concatenate([best_prices, new]), np.array(last_paths))


def usage_of_paths(network: Network, nodes: Ints) -> Floats:
    """Return y (n, M, S), the flow through each node, of paths (n, M)."""
    usage = np.zeros(network.node.shape)
    np.put_along_axis(usage, nodes[:, :, None], 1.0, axis=2)
    return usage
