"""Steps uphill along slopes that jump about: each number by steps of its own size, as Adam takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.network import Network
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator
from tracking.solvers.objective import Ints
from tracking.solvers.viterbi import MinMarginals, PathPricer, PrunedStates, best_paths

_MOMENTUM, _SECOND_MOMENT_DECAY = 0.6, 0.9
"""Shares of the former direction, and of the former typical size of a slope, in the next one."""

_EPSILON = 1e-3
"""Slopes far below this are no reason to move."""


class AdamSteps:
    """Remembers slopes; numbers may join at the end of the first axis."""

    def __init__(self) -> None:
        self._way = self._size = np.empty(0)
        self._weight = self._weight_of_size = 0.0

    def step(self, slope: Floats) -> Floats:
        """Return the next step, about 1 where the slopes agree with each other and near 0 where not."""
        if len(self._way) < len(slope):
            joined = np.zeros((len(slope) - len(self._way), *slope.shape[1:]))
            self._way = np.concatenate([self._way.reshape(-1, *slope.shape[1:]), joined])
            self._size = np.concatenate([self._size.reshape(-1, *slope.shape[1:]), joined])
        self._way = _MOMENTUM * self._way + (1.0 - _MOMENTUM) * slope
        self._size = _SECOND_MOMENT_DECAY * self._size + (1.0 - _SECOND_MOMENT_DECAY) * slope**2
        self._weight = _MOMENTUM * self._weight + (1.0 - _MOMENTUM)
        self._weight_of_size = _SECOND_MOMENT_DECAY * self._weight_of_size + (1.0 - _SECOND_MOMENT_DECAY)
        typical = np.sqrt(self._size / self._weight_of_size)
        return np.asarray(self._way / self._weight / (typical + _EPSILON))


def add_layout_prices(node: Floats, where: Floats, pulls: Floats) -> Floats:
    """Return the costs of nodes `node` (n, M, S) at `where` (n, M, S, 4) with what moves earn.

    `pulls` (n, M - 1, 4) is what a move by a pixel earns.
    """
    inward = np.zeros((*node.shape[:2], BOX_SIDES))
    inward[:, 1:] -= pulls
    inward[:, :-1] += pulls
    return np.asarray(node + (where @ inward[:, :, :, None])[:, :, :, 0])


class LayoutDuals:
    """Forces within [-μ, μ] on the difference of two objects' moves, climbing; 0 at first."""

    def __init__(self, network: Network) -> None:
        count = network.objects if network.layout else 0
        self._objects = network.objects
        self._pairs = np.array(list(combinations(range(count), 2)), dtype=np.int64).reshape(-1, 2)
        self._forces = np.zeros((len(self._pairs), network.frames - 1, BOX_SIDES))
        self._most = network.layout
        self._steps = AdamSteps()

    def layout_prices(self) -> Floats:
        """Return what a move by a pixel earns each object, (n, M - 1, 4)."""
        pulls = np.zeros((self._objects, *self._forces.shape[1:]))
        np.add.at(pulls, self._pairs[:, 0], self._forces)
        np.add.at(pulls, self._pairs[:, 1], -self._forces)
        return pulls

    def ascend(self, where: Floats, length: float) -> bool:
        """Step by `length` of the largest force, for objects at `where` (n, M, 4); False: all in step."""
        slope = self._slope(where)
        if not slope.any():
            return False
        self._forces += length * self._most * self._steps.step(slope)
        np.clip(self._forces, -self._most, self._most, out=self._forces)
        return True

    def _slope(self, where: Floats) -> Floats:
        """Return how much less the first of a pair moves than the second."""
        moves: Floats = np.diff(where, axis=1)
        first, second = self._pairs.T
        return np.asarray(moves[second] - moves[first])


class ConflictDuals:
    """Prices, never negative, of conflict rows on a packed trellis, climbing; rows join at price 0."""

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
        """Return the costs of nodes, `node` (n, M, W), with the prices."""
        if not len(self.prices):
            return node
        at = (self._frame == np.arange(self._frames)[:, None]) * self.prices
        added = at @ self._members.reshape(len(self.prices), -1)
        return np.asarray(node + np.swapaxes(added.reshape(self._frames, *self._members.shape[1:]), 0, 1))

    def ascend(self, slots: Ints, length: float) -> bool:
        """Step by `length` for objects in `slots` (n, M); False: no row is broken and none costs."""
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


_WITH_LAYOUT = _AscentSchedule(steps=30, shorter=0.94, states=40, price=1.0)
_BY_CONFLICTS = _AscentSchedule(steps=25, shorter=0.92, states=10, price=0.2)
"""The layout term leads further off the cheapest paths than conflicts do."""

_FIRST_FORCE_STEP = 0.2
"""Length of the first step of forces, as a share of the largest."""

_KEPT_PATHS = 8
"""Of the last paths met: they are near those of the optimum."""

_EARLY_STEPS, _SEPARATION_INTERVAL = 10, 3
"""Broken rows are looked for in each of the first steps, later in some: few are still to be found."""


@dataclass(frozen=True, slots=True, eq=False)
class DualGuess:
    """What the ascent came to.

    Attributes:
        rows: the conflict rows that cost, or that paths broke.
        prices: (R,) what going through them costs.
        layout_prices: (n, M - 1, 4) what a move by a pixel earns.
        paths: (G, n, M) the last paths met, of all objects at a time.
    """

    rows: list[ConflictRow]
    prices: Floats
    layout_prices: Floats
    paths: Ints


def guess_duals(network: Network, pricing: PathPricer, finder: ConflictSeparator) -> DualGuess:
    """Guess the duals of a network."""
    passes = MinMarginals.of(pricing.trellis, pricing.forward)
    pace = _WITH_LAYOUT if network.layout else _BY_CONFLICTS
    packed = PrunedStates.cheapest(passes.through, pace.states)
    trellis = packed.trellis(pricing.trellis)
    forces, prices = LayoutDuals(network), ConflictDuals(packed)
    where = packed.states(network.locations[network.sets], 0.0) if network.layout else None
    typical = _typical_price(packed.states(passes.through, np.inf), passes.least)
    each, frames = np.indices((network.objects, network.frames))
    best, best_prices, best_pulls = -np.inf, prices.prices, forces.layout_prices()
    met: list[Ints] = []
    for step in range(pace.steps):
        node, pulls = prices.add_to(trellis.node), forces.layout_prices()
        paths = best_paths(
            trellis.with_node(node if where is None else add_layout_prices(node, where, pulls))
        )
        met = [*met, packed.original_states(paths.nodes)][-_KEPT_PATHS:]
        bound = float(paths.costs.sum() - prices.prices.sum())
        if bound > best:
            best, best_prices, best_pulls = bound, prices.prices, pulls
        if step < _EARLY_STEPS or step % _SEPARATION_INTERVAL == 0:
            usage = np.zeros(network.node.shape)
            usage[each, frames, met[-1]] = 1.0
            prices.add_rows(finder.find_violated(usage))
        length = pace.shorter**step
        moved = prices.ascend(paths.nodes, length * pace.price * typical)
        if where is not None:
            moved |= forces.ascend(where[each, frames, paths.nodes], length * _FIRST_FORCE_STEP)
        if not moved:
            break
    late = np.zeros(len(prices.prices) - len(best_prices))
    return DualGuess(prices.rows, np.concatenate([best_prices, late]), best_pulls, np.array(met))


def _typical_price(through: Floats, least: Floats) -> float:
    """Return what it costs on average to be in the second best state of a frame; (n, M, W) and (n,)."""
    if through.shape[2] == 1:
        return 0.0
    regret = np.partition(through, 1, axis=2)[:, :, 1] - least[:, None]
    return float(regret[np.isfinite(regret)].mean()) if np.isfinite(regret).any() else 0.0
