"""Approximate dual ascent with Adam steps: a starting point for column generation over arcs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.network import Network
from tracking.solvers.budget import RELAXATION_SHARE, BudgetMeter
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator
from tracking.solvers.objective import Ints
from tracking.solvers.viterbi import MinMarginals, PathPricer, PrunedStates, best_paths

_MOMENTUM, _SECOND_MOMENT_DECAY = 0.6, 0.9
"""Decay of the first and of the second moment of the slopes."""

_EPSILON = 1e-3
"""Added to the typical slope: much smaller slopes cause no step."""


class AdamSteps:
    """Adam steps (Kingma, Ba 2015); variables may be appended along the first axis."""

    def __init__(self) -> None:
        self._moment = self._second_moment = np.empty(0)
        self._weight = self._second_weight = 0.0

    def step(self, slope: Floats) -> Floats:
        """Return the next step: about 1 where the slopes keep their sign, and near 0 elsewhere."""
        if len(self._moment) < len(slope):
            appended = np.zeros((len(slope) - len(self._moment), *slope.shape[1:]))
            self._moment = np.concatenate([self._moment.reshape(-1, *slope.shape[1:]), appended])
            self._second_moment = np.concatenate(
                [self._second_moment.reshape(-1, *slope.shape[1:]), appended]
            )
        self._moment = _MOMENTUM * self._moment + (1.0 - _MOMENTUM) * slope
        self._second_moment = (
            _SECOND_MOMENT_DECAY * self._second_moment + (1.0 - _SECOND_MOMENT_DECAY) * slope**2
        )
        self._weight = _MOMENTUM * self._weight + (1.0 - _MOMENTUM)
        self._second_weight = _SECOND_MOMENT_DECAY * self._second_weight + (1.0 - _SECOND_MOMENT_DECAY)
        typical = np.sqrt(self._second_moment / self._second_weight)
        return np.asarray(self._moment / self._weight / (typical + _EPSILON))


def add_layout_prices(node: Floats, locations: Floats, layout_prices: Floats) -> Floats:
    """Return node costs `node` (n, M, S) at `locations` (n, M, S, 4) with the layout prices.

    `layout_prices` (n, M - 1, 4) is the gain per pixel of movement.
    """
    prices = np.zeros((*node.shape[:2], BOX_SIDES))
    prices[:, 1:] -= layout_prices
    prices[:, :-1] += layout_prices
    return np.asarray(node + (locations @ prices[:, :, :, None])[:, :, :, 0])


class LayoutDuals:
    """Duals in [-μ, μ] of the difference of two objects' movements, initially 0."""

    def __init__(self, network: Network) -> None:
        count = network.objects if network.layout else 0
        self._objects = network.objects
        self._pairs = np.array(list(combinations(range(count), 2)), dtype=np.int64).reshape(-1, 2)
        self._forces = np.zeros((len(self._pairs), network.frames - 1, BOX_SIDES))
        self._limit = network.layout
        self._steps = AdamSteps()

    def layout_prices(self) -> Floats:
        """Return each object's gain per pixel of movement, (n, M - 1, 4)."""
        prices = np.zeros((self._objects, *self._forces.shape[1:]))
        np.add.at(prices, self._pairs[:, 0], self._forces)
        np.add.at(prices, self._pairs[:, 1], -self._forces)
        return prices

    def ascend(self, locations: Floats, length: float) -> bool:
        """Step by `length` of the largest dual, for objects at `locations` (n, M, 4); False: zero slope."""
        slope = self._slope(locations)
        if not slope.any():
            return False
        self._forces += length * self._limit * self._steps.step(slope)
        np.clip(self._forces, -self._limit, self._limit, out=self._forces)
        return True

    def _slope(self, locations: Floats) -> Floats:
        """Return the movement of the second object of each pair minus that of the first."""
        moves: Floats = np.diff(locations, axis=1)
        first, second = self._pairs.T
        return np.asarray(moves[second] - moves[first])


class ConflictDuals:
    """Prices of conflict rows on a pruned trellis, not negative; new rows start at 0."""

    def __init__(self, packed: PrunedStates) -> None:
        self._packed = packed
        objects, self._frames, width = packed.index.shape
        self._members = np.zeros((0, objects, width))
        self._frame = np.empty(0, dtype=np.int64)
        self._steps = AdamSteps()
        self.rows: list[ConflictRow] = []
        self.prices = np.empty(0)

    def add_rows(self, rows: Sequence[ConflictRow]) -> None:
        """Add rows to be priced."""
        if not rows:
            return
        each = np.arange(self._members.shape[1])[:, None]
        members = [row.members[each, self._packed.index[:, row.frame]] for row in rows]
        self._members = np.concatenate([self._members, np.array(members, dtype=np.float64)])
        self._frame = np.concatenate([self._frame, [row.frame for row in rows]])
        self.prices = np.concatenate([self.prices, np.zeros(len(rows))])
        self.rows.extend(rows)

    def add_to(self, node: Floats) -> Floats:
        """Return node costs `node` (n, M, W) with the prices."""
        if not len(self.prices):
            return node
        frame_prices = (self._frame == np.arange(self._frames)[:, None]) * self.prices
        added = frame_prices @ self._members.reshape(len(self.prices), -1)
        return np.asarray(node + np.swapaxes(added.reshape(self._frames, *self._members.shape[1:]), 0, 1))

    def ascend(self, slots: Ints, length: float) -> bool:
        """Step by `length` for objects in `slots` (n, M); False: no row is violated or has a price."""
        if not len(self.prices):
            return False
        rows, each = np.arange(len(self.prices))[:, None], np.arange(len(slots))
        slope = self._members[rows, each, slots[:, self._frame].T].sum(axis=1) - 1.0
        slope[(slope < 0.0) & (self.prices == 0.0)] = 0.0
        if not slope.any():
            return False
        self.prices = np.maximum(0.0, self.prices + length * self._steps.step(slope))
        return True


@dataclass(frozen=True, slots=True)
class _AscentSchedule:
    """Step schedule of an ascent.

    Attributes:
        steps: number of steps.
        decay: length of each step over the one before.
        states: number of states per frame and object, the cheapest without prices.
        price: length of the first price step, as a share of a typical price.
    """

    steps: int
    decay: float
    states: int
    price: float


_WITH_LAYOUT = _AscentSchedule(steps=30, decay=0.94, states=40, price=1.0)
_CONFLICTS_ONLY = _AscentSchedule(steps=25, decay=0.92, states=10, price=0.2)
"""The layout term moves the optimum further from the cheapest paths than conflicts do."""

_FIRST_FORCE_STEP = 0.2
"""Length of the first step of layout duals, as a share of the largest."""

_KEPT_PATHS = 8
"""Number of the last paths that are kept: they are near those of the optimum."""

_SHARE = 0.3
"""Largest share of the budget, if a program is solved after it."""

_LAST_STEP, _MAX_STEPS = 0.05, 300
"""Length of the last step over the first, and most steps, if no program is solved after it."""

_EARLY_STEPS, _SEPARATION_INTERVAL = 10, 3
"""Violated rows are searched in each of the first steps, then in every few steps: later there are few."""


@dataclass(frozen=True, slots=True, eq=False)
class DualGuess:
    """Result of the ascent.

    Attributes:
        rows: the conflict rows that were violated.
        prices: (R,) their prices.
        layout_prices: (n, M - 1, 4) the gain per pixel of movement.
        paths: (G, n, M) the last paths of all objects.
    """

    rows: list[ConflictRow]
    prices: Floats
    layout_prices: Floats
    paths: Ints


def guess_duals(
    network: Network,
    pricing: PathPricer,
    finder: ConflictSeparator,
    meter: BudgetMeter,
    *,
    is_last: bool = False,
) -> DualGuess:
    """Approximate the optimal duals of a network, with at least one step.

    `is_last`: no program is solved after it, so that it takes as many steps as the budget allows.
    """
    passes = MinMarginals.of(pricing.trellis, pricing.forward)
    schedule = _WITH_LAYOUT if network.layout else _CONFLICTS_ONLY
    packed = PrunedStates.cheapest(passes.through, schedule.states)
    share = RELAXATION_SHARE if is_last else _SHARE
    if is_last:
        schedule = _schedule_until(schedule, packed, meter, share)
    trellis = packed.trellis(pricing.trellis)
    forces, prices = LayoutDuals(network), ConflictDuals(packed)
    locations = packed.states(network.locations[network.sets], 0.0) if network.layout else None
    typical = _typical_price(packed.states(passes.through, np.inf), passes.least)
    each, frames = np.indices((network.objects, network.frames))
    best, best_prices, best_layout_prices = -np.inf, prices.prices, forces.layout_prices()
    last_paths: list[Ints] = []
    for step in range(schedule.steps):
        node, layout_prices = prices.add_to(trellis.node), forces.layout_prices()
        paths = best_paths(
            trellis.with_node(
                node if locations is None else add_layout_prices(node, locations, layout_prices)
            )
        )
        last_paths = [*last_paths, packed.original_states(paths.nodes)][-_KEPT_PATHS:]
        bound = float(paths.costs.sum() - prices.prices.sum())
        if bound > best:
            best, best_prices, best_layout_prices = bound, prices.prices, layout_prices
        if step < _EARLY_STEPS or step % _SEPARATION_INTERVAL == 0:
            usage = np.zeros(network.node.shape)
            usage[each, frames, last_paths[-1]] = 1.0
            prices.add_rows(finder.find_new_violated(usage))
        length = schedule.decay**step
        moved = prices.ascend(paths.nodes, length * schedule.price * typical)
        if locations is not None:
            moved |= forces.ascend(locations[each, frames, paths.nodes], length * _FIRST_FORCE_STEP)
        _add_step(meter, packed)
        if not moved or meter.reached(share):
            break
    new = np.zeros(len(prices.prices) - len(best_prices))
    return DualGuess(
        prices.rows, np.concatenate([best_prices, new]), best_layout_prices, np.array(last_paths)
    )


def _add_step(meter: BudgetMeter, packed: PrunedStates) -> None:
    objects, frames, states = packed.index.shape
    meter.add_step()
    meter.add_passes(objects, frames, states)
    meter.add_layout(objects * (objects + states), frames, 1)


def _schedule_until(
    schedule: _AscentSchedule, packed: PrunedStates, meter: BudgetMeter, share: float
) -> _AscentSchedule:
    """Return the schedule with as many steps as the budget's share allows, at least those it has."""
    one = BudgetMeter()
    _add_step(one, packed)
    steps = int(min(max(meter.left(share) / one.work_s, schedule.steps), _MAX_STEPS))
    return replace(schedule, steps=steps, decay=_LAST_STEP ** (1.0 / steps))


def _typical_price(through: Floats, least: Floats) -> float:
    """Return the mean excess cost of the second best state per frame, from costs (n, M, W) and (n,)."""
    if through.shape[2] == 1:
        return 0.0
    excess = np.partition(through, 1, axis=2)[:, :, 1] - least[:, None]
    return float(excess[np.isfinite(excess)].mean()) if np.isfinite(excess).any() else 0.0
