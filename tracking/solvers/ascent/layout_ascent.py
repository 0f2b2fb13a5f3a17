"""Dual ascent for the layout term: prices on movements and conflicts, whose cheapest paths prove a bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.ascent.adam import AdamSteps
from tracking.solvers.ascent.conflict_duals import ConflictDuals, typical_price
from tracking.solvers.ascent.dual_ascent import usage_of_paths
from tracking.solvers.ascent.movement_prices import (
    MovementCells,
    MovementLengths,
    hiding_tolls,
    slopes_from_tensions,
)
from tracking.solvers.ascent.soft_paths import node_shares, soft_paths
from tracking.solvers.budget import RELAXATION_SHARE, BudgetMeter
from tracking.solvers.cutting_planes import ConflictSeparator
from tracking.solvers.objective import Ints, conflict_count, total_cost
from tracking.solvers.relaxation import OPTIMALITY_TOLERANCE, RelaxedSolution, add_conflict_prices
from tracking.solvers.viterbi import MinMarginals, PathPricer, PrunedStates, Trellis, trace_back

_STEPS = 80
"""Steps where the budget allows them."""

_PROOFS = 8
"""How often all paths are priced on the way, which proves a bound and finds violated conflict rows."""

_EARLY_PROOFS, _LEAST_GAIN = 2, 5e-4
"""Proofs that need not raise the bound, and the relative gain below which a later one is the last."""

_FIRST_TEMPERATURE, _LAST_TEMPERATURE = 0.2, 0.02
"""Temperatures of the soft paths, relative to what all others can charge for a movement by a height."""

_FIRST_STEP, _LAST_STEP = 0.5, 0.1
"""Lengths of the steps of tensions; a difference of 1 is the most that counts."""

_MOMENTUM, _DECAY, _EPSILON = 0.9, 0.95, 0.03
"""Decays of the moments of the slopes, and what is added to the typical slope."""

_FIRST_SHARE, _LARGEST_SHARE, _SHARE_STEP = 0.3, 0.95, 0.1
"""Share of the layout term for the tolls of hiding, and length of its steps relative to those of tensions."""


@dataclass(frozen=True, slots=True, eq=False)
class _Proof:
    """A pass over all paths at some prices, and the bound that it proves."""

    trellis: Trellis
    passes: MinMarginals
    bound: float
    frame_prices: Floats


class LayoutAscent:
    """One ascent for a network with a layout term, two objects and two frames at least; `run` it once.

    A step follows the gradient of soft paths, which grow harder; the bound is that of the cheapest ones.
    """

    def __init__(
        self, network: Network, pricing: PathPricer, finder: ConflictSeparator, meter: BudgetMeter
    ) -> None:
        self._network, self._finder, self._meter = network, finder, meter
        cells = MovementCells.of(network)
        self._lengths = MovementLengths(network, cells)
        self._tolls = hiding_tolls(network)
        self._scale = (1.0 / cells.widths()).astype(np.float32)
        self._charge = network.layout * (network.objects - 1) * cells.height
        self._tensions = np.zeros((network.objects, network.frames - 1, len(self._scale)), dtype=np.float32)
        self._shares = np.full(network.frames - 1, _FIRST_SHARE if self._tolls.any() else 0.0)
        self._tension_steps = AdamSteps(_MOMENTUM, _DECAY, _EPSILON)
        self._share_steps = AdamSteps(_MOMENTUM, _DECAY, _EPSILON * float(self._tolls.max(initial=1.0)))
        passes = MinMarginals.of(pricing.trellis, pricing.forward)
        self._typical = typical_price(passes.through, passes.least)
        states = network.max_places + 1
        self._conflicts = ConflictDuals(PrunedStates.cheapest(passes.through, states))
        self._conflicts.add_rows(finder.find_new_violated(usage_of_paths(network, pricing.alone.nodes)))
        self._best = _Proof(pricing.trellis, passes, float(passes.least.sum()), np.zeros(network.frames))
        self._usage = usage_of_paths(network, pricing.alone.nodes)
        # Prices of nodes change in each step, the rest of the costs of arcs does not.
        self._pair = network.pair[network.pair_sets].copy()
        self._pair[:, 0] += network.source[:, :, None]
        self._pair[:, -1] += network.sink[:, None]
        self._fixed = self._pair.astype(np.float32)

    def run(self) -> RelaxedSolution:
        """Return the best bound, and the last soft paths as the flow."""
        steps = self._affordable_steps()
        proofs = [(part * steps) // _PROOFS - 1 for part in range(1, _PROOFS + 1)]
        is_closed = self._prove()
        for step in range(steps):
            if is_closed or self._meter.reached(RELAXATION_SHARE):
                break
            self._step(step / max(steps - 1, 1))
            if step in proofs:
                before, is_closed = self._best.bound, self._prove()
                gain = self._best.bound - before
                if proofs.index(step) >= _EARLY_PROOFS and gain < _LEAST_GAIN * max(1.0, abs(before)):
                    break
        is_cut = not is_closed and steps < _STEPS
        return RelaxedSolution(
            usage=self._usage,
            bound=self._best.bound,
            priced=self._best.trellis,
            rounds=0,
            bound_reductions=self._best.frame_prices,
            limit=(self._meter.reached(RELAXATION_SHARE) or "work") if is_cut else None,
            is_optimum=False,
        )

    def _affordable_steps(self) -> int:
        """Return how many steps the budget allows beside the proofs."""
        one, proofs = BudgetMeter(), BudgetMeter()
        self._add_step(one)
        for _ in range(_PROOFS + 1):
            self._add_proof(proofs)
        left = (self._meter.left(RELAXATION_SHARE) - proofs.work_s) / one.work_s
        return int(min(max(left, 1), _STEPS))

    def _add_step(self, meter: BudgetMeter) -> None:
        meter.add_step()
        meter.add_movement_prices(*self._tensions.shape, self._network.max_places + 1)

    def _add_proof(self, meter: BudgetMeter) -> None:
        self._add_step(meter)
        meter.add_passes(2 * self._network.objects, self._network.frames, self._network.max_places + 1)

    def _step(self, progress: float) -> None:
        """Step along the gradient; `progress` is 0 in the first and 1 in the last step."""
        network = self._network
        length = _FIRST_STEP * (_LAST_STEP / _FIRST_STEP) ** progress
        heat = self._charge * _FIRST_TEMPERATURE * (_LAST_TEMPERATURE / _FIRST_TEMPERATURE) ** progress
        limits = network.layout * (1.0 - self._shares)
        prices = self._lengths.prices(slopes_from_tensions(self._tensions, limits))
        node = self._conflicts.add_to(network.node).astype(np.float32)
        tolls = (network.layout * self._shares[:, None, None] * self._tolls).astype(np.float32)
        costs = prices + self._fixed
        costs += tolls
        costs += node[:, 1:, None]
        costs[:, 0] += node[:, 0][:, :, None]
        arcs = soft_paths(costs, heat)
        nodes = node_shares(arcs).astype(np.float64)
        self._tensions += np.float32(length) * self._tension_steps.step(
            self._lengths.moved(arcs) * self._scale
        )
        self._conflicts.ascend(self._conflicts.loads_of_shares(nodes), length * self._typical)
        if self._tolls.any():
            paid = np.einsum("nmij,pmij->m", arcs, self._tolls)
            lost = np.einsum("nmij,nmij->m", arcs, prices) / limits
            self._shares += _SHARE_STEP * length * self._share_steps.step(paid - lost)
            np.clip(self._shares, 0.0, _LARGEST_SHARE, out=self._shares)
        self._usage = nodes
        self._add_step(self._meter)

    def _prove(self) -> bool:
        """Price all paths, remember the best bound, and return whether it is the optimum."""
        network, conflicts = self._network, self._conflicts
        limits = network.layout * (1.0 - self._shares)
        slopes = slopes_from_tensions(self._tensions.astype(np.float64), limits)
        pair = np.asarray(self._lengths.prices(slopes), dtype=np.float64)
        pair += network.layout * self._shares[:, None, None] * self._tolls
        pair += network.pair
        node = add_conflict_prices(network, conflicts.rows, conflicts.prices)
        trellis = Trellis(network.source, node, pair, network.sink)
        passes = MinMarginals.of(trellis)
        frame_prices = np.zeros(network.frames)
        np.add.at(
            frame_prices, np.array([row.frame for row in conflicts.rows], dtype=np.int64), conflicts.prices
        )
        proof = _Proof(trellis, passes, float(passes.least.sum() - frame_prices.sum()), frame_prices)
        if proof.bound > self._best.bound:
            self._best = proof
        nodes = trace_back(trellis, passes.forward).nodes
        conflicts.add_rows(self._finder.find_new_violated(usage_of_paths(network, nodes)))
        # Relative to the cost ahead, arcs of good paths cost about as much as the cheapest of their step.
        ahead = np.swapaxes(passes.backward, 0, 1)
        ahead = np.where(np.isfinite(ahead), ahead, 0.0)
        ahead -= ahead.min(axis=2, keepdims=True)
        self._fixed = self._pair.astype(np.float32)
        self._fixed[:, :-1] += ahead[:, 1:-1, None].astype(np.float32)
        self._fixed[:, 1:] -= ahead[:, 1:-1, :, None].astype(np.float32)
        self._add_proof(self._meter)
        return self._is_closed(nodes)

    def _is_closed(self, nodes: Ints) -> bool:
        """Return whether paths without conflicts cost no more than the bound."""
        if conflict_count(self._network, nodes):
            return False
        cost = total_cost(self._network, nodes)
        return cost - self._best.bound <= OPTIMALITY_TOLERANCE * max(1.0, abs(cost))
