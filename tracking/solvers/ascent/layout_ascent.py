"""Dual ascent for the layout term: prices on movements and conflicts, whose cheapest paths prove a bound."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.ascent.adam import AdamSteps
from tracking.solvers.ascent.conflict_duals import ConflictDuals, typical_price
from tracking.solvers.ascent.dual_ascent import usage_of_paths
from tracking.solvers.ascent.leap_tolls import leap_tolls
from tracking.solvers.ascent.movement_prices import (
    MovementCells,
    MovementLengths,
    MovementPrices,
    slopes_from_tensions,
)
from tracking.solvers.ascent.soft_paths import SoftPaths
from tracking.solvers.budget import RELAXATION_SHARE, BudgetMeter
from tracking.solvers.cutting_planes import ConflictSeparator
from tracking.solvers.heuristics.candidates import without_conflicts
from tracking.solvers.heuristics.recombination import recombine
from tracking.solvers.hidden_paths import hidden_nodes
from tracking.solvers.objective import Ints, total_cost
from tracking.solvers.relaxation import CLOSE_GAP, KnownAnswer, RelaxedSolution
from tracking.solvers.sparse_trellis import SparseTrellis
from tracking.solvers.viterbi import PrunedStates, Trellis

_STEPS = 64
"""Steps where the budget allows them."""

_PROOF_INTERVAL = 12
"""Steps after which all paths are priced, which proves a bound and finds violated conflict rows."""

_STEPS_OF_PROOF, _STEPS_OF_START = 3, 4
"""Work of a proof and of the start, in steps."""

_FEW_ARCS = 5000
"""Of more arcs, the first proof comes after the first steps: it takes as long as a dozen of them."""

_LEAST_GAIN = 0.05
"""The ascent ends after a proof that closes less than this share of the gap."""

_WORTH_DROPPING = 0.7
"""Arcs are dropped if no more than this share of them is kept."""

_MANY_ARCS = 1200
"""Of more arcs than that, the steps look only at those on the cheapest paths."""

_TOLERANCE = 1e-9
"""Relative rounding error of sums of costs."""

_FIRST_TEMPERATURE, _LAST_TEMPERATURE = 0.2, 0.03
"""Temperatures of the soft paths, relative to the geometric mean of the typical excess cost of the second
best state and what all others charge for a movement by a height."""

_LEAST_HEAT = 0.05
"""The former excess cost relative to that charge at least: with ties it is zero."""

_FIRST_STEP, _LAST_STEP = 0.5, 0.1
"""Lengths of the steps of tensions; a difference of 1 is the most that counts."""

_MOMENTUM, _DECAY, _EPSILON = 0.8, 0.95, 0.03
"""Decays of the moments of the slopes, and what is added to the typical slope."""

_CONFLICT_STEP, _CONFLICT_EPSILON = 0.4, 1e-3
"""Length of the steps of conflict prices, relative to those of tensions and the typical excess cost."""

_FIRST_SHARE, _LARGEST_SHARE, _SHARE_STEP = 0.7, 0.95, 0.1
"""Share of the layout term of leaps for their tolls; length of its steps relative to those of tensions."""


@dataclass(frozen=True, slots=True, eq=False)
class _Proof:
    """The prices that prove a bound: of movements and tolls on each arc (n, E), and of conflict rows (R,)."""

    bound: float
    arcs: Floats
    rows: Floats


class LayoutAscent:
    """One ascent for a network with a layout term, two objects and two frames at least; `run` it once.

    A step follows the gradient of soft paths, which grow harder; the bound is that of the cheapest ones.
    """

    def __init__(self, network: Network, finder: ConflictSeparator, meter: BudgetMeter) -> None:
        self._network, self._finder, self._meter = network, finder, meter
        trellis = SparseTrellis.of(network)
        forward, backward = trellis.forward(trellis.costs), trellis.backward(trellis.costs)
        alone = trellis.best_paths(trellis.costs, forward)
        through = np.swapaxes(forward + backward, 0, 1)
        self._typical = typical_price(through, alone.costs)
        states = PrunedStates.cheapest(through, trellis.states)
        self._conflicts = ConflictDuals(states, AdamSteps(_MOMENTUM, _DECAY, _CONFLICT_EPSILON))
        self._answer = hidden_nodes(network)
        self._paths = [self._answer]
        self._learn(alone.nodes)
        self._usage = usage_of_paths(network, alone.nodes)
        cells = MovementCells.of(network)
        bound, excess = float(alone.costs.sum()), trellis.excess(trellis.costs, forward, backward)
        kept = self._worth_keeping(excess, bound)
        self._best = _Proof(bound, np.zeros((network.objects, int(kept.sum()))), np.zeros(0))
        self._all = MovementPrices.of(cells, trellis.select(kept), network.locations)
        self._all_tolls = leap_tolls(network, self._all.trellis, cells.leap)
        self._focus(excess[:, kept], self._all.trellis.costs)
        self._leaps = cells.are_leaps()
        self._scale = (1.0 / cells.widths()).astype(np.float32)
        charge = network.layout * (network.objects - 1) * cells.height
        self._heat = float(np.sqrt(max(self._typical, _LEAST_HEAT * charge) * charge))
        self._tensions = np.zeros((network.objects, network.frames - 1, len(self._scale)), dtype=np.float32)
        self._shares = np.full(network.frames - 1, _FIRST_SHARE if self._all_tolls.any() else 0.0)
        self._tension_steps = AdamSteps(_MOMENTUM, _DECAY, _EPSILON)
        self._share_steps = AdamSteps(_MOMENTUM, _DECAY, _EPSILON * float(self._all_tolls.max(initial=1.0)))
        self._add_steps(meter, _STEPS_OF_START)

    def run(self) -> RelaxedSolution:
        """Return the best bound, and the last soft paths as the flow."""
        is_done = len(self._all.trellis) <= _FEW_ARCS and self._prove()
        steps, progress = 0, 0.0
        while progress < 1.0 and not is_done and not self._meter.reached(RELAXATION_SHARE):
            self._step(progress)
            # Arcs are dropped on the way, so that more steps become affordable.
            progress += (1.0 - progress) / max(min(self._affordable_steps(), _STEPS - steps), 1)
            steps += 1
            if steps % _PROOF_INTERVAL == 0 or progress >= 1.0:
                before = self._best.bound
                is_done = self._prove()
                gain = self._best.bound - before
                is_done |= gain < _LEAST_GAIN * (self._answer_cost - before)
        is_cut = not is_done and steps < _STEPS
        network, best = self._network, self._best
        frames = np.array([row.frame for row in self._conflicts.rows[: len(best.rows)]], dtype=np.int64)
        return RelaxedSolution(
            usage=self._usage,
            # Without the dropped arcs the bound may exceed what the known answer costs.
            bound=min(best.bound, self._answer_cost),
            priced=self._priced_trellis(),
            rounds=0,
            bound_reductions=np.bincount(frames, best.rows, network.frames).astype(np.float64),
            limit=(self._meter.reached(RELAXATION_SHARE) or "work") if is_cut else None,
            is_optimum=False,
            answer=KnownAnswer(self._answer, self._trellis),
        )

    def _priced_trellis(self) -> Trellis:
        """Return the trellis with the prices of the best bound."""
        network, best = self._network, self._best
        node = network.node + self._conflicts.price_nodes(best.rows)
        trellis = self._all.trellis
        pair = trellis.dense(trellis.pairs(network.pair) + best.arcs)
        return Trellis(network.source, node, pair, network.sink)

    def _affordable_steps(self) -> int:
        """Return how many steps the budget allows beside their proofs."""
        step = BudgetMeter()
        self._add_steps(step, 1)
        steps = self._meter.left(RELAXATION_SHARE) / step.work_s - _STEPS_OF_PROOF
        return int(min(max(steps, 0.0) / (1.0 + _STEPS_OF_PROOF / _PROOF_INTERVAL), _STEPS))

    def _add_steps(self, meter: BudgetMeter, count: int) -> None:
        for _ in range(count):
            meter.add_movement_prices(*self._tensions.shape, len(self._trellis))

    def _limits(self) -> Floats:
        """Return how much a pair pays at most for each pixel of movement in each cell, (M - 1, 4 C)."""
        return self._network.layout * (1.0 - self._shares[:, None] * self._leaps)

    def _step(self, progress: float) -> None:
        """Step along the gradient; `progress` is 0 in the first and 1 in the last step."""
        network, trellis = self._network, self._trellis
        length = _FIRST_STEP * (_LAST_STEP / _FIRST_STEP) ** progress
        heat = self._heat * _FIRST_TEMPERATURE * (_LAST_TEMPERATURE / _FIRST_TEMPERATURE) ** progress
        slopes = slopes_from_tensions(self._tensions, self._limits())
        costs = self._lengths.prices(slopes)
        costs += self._fixed
        costs += (network.layout * self._shares[trellis.step] * self._tolls).astype(np.float32)
        if len(self._conflicts.prices):
            costs += trellis.nodes(self._conflicts.price_nodes(self._conflicts.prices).astype(np.float32))
        soft = self._soft_paths.shares(costs, heat)
        moved, nodes = self._lengths.moved(soft.arcs), soft.nodes.astype(np.float64)
        self._tensions += np.float32(length) * self._tension_steps.step(moved * self._scale)
        self._conflicts.ascend(
            self._conflicts.loads_of_shares(nodes), _CONFLICT_STEP * length * self._typical
        )
        if self._tolls.any():
            paid = np.bincount(trellis.step, soft.arcs.sum(axis=0) * self._tolls)
            charged = np.einsum("nmc,nmc->m", moved, slopes * self._leaps)
            lost = charged / (network.layout * (1.0 - self._shares))
            self._shares += _SHARE_STEP * length * self._share_steps.step(paid - lost)
            np.clip(self._shares, 0.0, _LARGEST_SHARE, out=self._shares)
        self._usage = nodes
        self._add_steps(self._meter, 1)

    def _prove(self) -> bool:
        """Price all paths, remember the best bound, and return whether an answer is close to it."""
        network, trellis = self._network, self._all.trellis
        slopes = slopes_from_tensions(self._tensions.astype(np.float64), self._limits())
        prices = self._all.of_slopes(slopes)
        prices += network.layout * self._shares[trellis.step] * self._all_tolls
        rows = self._conflicts.prices
        costs = trellis.costs + prices + trellis.nodes(self._conflicts.price_nodes(rows))
        forward = trellis.forward(costs)
        paths = trellis.best_paths(costs, forward)
        bound = float(paths.costs.sum() - rows.sum())
        if bound > self._best.bound:
            self._best = _Proof(bound, prices, rows)
        self._learn(paths.nodes)
        backward = trellis.backward(costs)
        # Relative to the cost ahead, arcs of good paths cost about as much as the cheapest of their step.
        ahead = np.swapaxes(backward, 0, 1)
        ahead = np.where(np.isfinite(ahead), ahead, 0.0)
        ahead -= ahead.min(axis=2, keepdims=True)
        ahead[:, [0, -1]] = 0.0
        relative = trellis.costs + trellis.differences(ahead)
        excess = trellis.excess(costs, forward, backward)
        kept = self._worth_keeping(excess, bound)
        if kept.sum() < _WORTH_DROPPING * len(kept):
            self._all, self._all_tolls = self._all.select(kept), self._all_tolls[kept]
            self._best = replace(self._best, arcs=self._best.arcs[:, kept])
            excess, relative = excess[:, kept], relative[:, kept]
        self._focus(excess, relative)
        self._add_steps(self._meter, _STEPS_OF_PROOF)
        gap = self._answer_cost - self._best.bound
        return gap <= CLOSE_GAP * max(1.0, abs(self._answer_cost))

    def _worth_keeping(self, excess: Floats, bound: float) -> Bools:
        """Return which arcs (E,) may be on an answer that is cheaper than the known one.

        `excess` (n, E) is that of the paths through each arc at the prices that prove the `bound`.
        """
        limit = self._answer_cost - bound + _TOLERANCE * max(1.0, abs(bound))
        return np.asarray((excess <= limit).any(axis=0))

    def _focus(self, excess: Floats, costs: Floats) -> None:
        """Choose the arcs that the next steps look at, all or the best of many; `costs` (n, E) are theirs."""
        least = excess.min(axis=0)
        near = np.ones(len(least), dtype=np.bool_)
        if len(near) > _MANY_ARCS:
            near = least <= np.partition(least, _MANY_ARCS)[_MANY_ARCS]
        arcs = self._all.select(near)
        self._trellis, self._lengths = arcs.trellis, MovementLengths(arcs)
        self._soft_paths = SoftPaths(arcs.trellis)
        self._tolls, self._fixed = self._all_tolls[near], costs[:, near].astype(np.float32)

    def _learn(self, nodes: Ints) -> None:
        """Add the conflict rows that paths `nodes` (n, M) violate; search a cheaper answer with the paths."""
        network = self._network
        self._conflicts.add_rows(self._finder.find_new_violated(usage_of_paths(network, nodes)))
        self._paths.insert(0, nodes)
        answers = [self._answer, without_conflicts(network, nodes)]
        cheapest = min(answers, key=lambda answer: total_cost(network, answer))
        self._answer = recombine(network, [cheapest, *answers, *self._paths], 1, self._meter)
        self._answer_cost = total_cost(network, self._answer)
