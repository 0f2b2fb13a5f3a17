"""`extended-dp`: dynamic programming over the joint states of all objects (paper I.A, reference [1])."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.base import Solution, TimedSolver
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.objective import Ints, conflict_count
from tracking.solvers.relaxation import RelaxedSolution
from tracking.solvers.solution_builder import (
    Certificate,
    build_solution,
    empty_solution,
    solution_from_relaxation,
)
from tracking.solvers.viterbi import Trellis, best_paths
from tracking.solvers.warm_start import WarmStart

_MAX_NUMBERS = 30_000_000
"""Numbers in memory at once: 240 MB, for example three objects with 70 places."""


_JOINT_ARC = 1e-8
"""Seconds of work for a pair of joint states, or for a joint state and a state of one object."""


class JointDpSolver(TimedSolver):
    """The integer optimum over all joint states: a reference for up to about three objects.

    Without the layout term a step between frames separates by object, and a window takes O(M n S^(n+1)); with
    it, O(M S^(2n)).
    """

    name = "extended-dp"

    def _solve(self, network: Network, warm_start: WarmStart | None, meter: BudgetMeter) -> Solution:
        """Return the cheapest states without conflicts; the bound is their cost.

        Where the budget does not allow all joint states, they are those of greedy paths and local search.

        Raises:
            ValueError: the objects have too many joint states.
        """
        if not network.objects:
            return empty_solution(self.name, network)
        power = 2 * network.objects if network.layout else network.objects + 1
        if (network.max_places + 1) ** power > _MAX_NUMBERS:
            raise ValueError(
                f"extended-dp cannot hold the joint states of {network.objects} objects in"
                f" {network.max_places} places; columns or exact can"
            )
        meter.work_s += _JOINT_ARC * network.frames * float(network.max_places + 1) ** power
        if limit := meter.reached():
            alone = best_paths(Trellis.of(network))
            usage = np.zeros(network.node.shape)
            np.put_along_axis(usage, alone.nodes[:, :, None], 1.0, axis=2)
            found = RelaxedSolution(
                usage, float(alone.costs.sum()), Trellis.of(network), rounds=0, limit=limit
            )
            return solution_from_relaxation(self.name, network, found, meter, warm_start=warm_start)
        nodes = _JointStates(network).best()
        # The optimum is its own bound, unless every answer has conflicts or a missing arc.
        bound = -np.inf if conflict_count(network, nodes) else np.inf
        return build_solution(network, nodes, Certificate(self.name, bound, integral=False, rounds=1))


class _JointStates:
    """Dynamic program over joint states, which are arrays with n axes of S states."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._exclusions = network.exclusions()

    def best(self) -> Ints:
        """Compute the costs forward over all frames, and trace back the cheapest."""
        network = self._network
        costs = [self._sum(network.source + network.node[:, 0]) + self._exclusion_costs(0)]
        for m in range(1, network.frames):
            step = self._step_with_layout if network.layout else self._step
            costs.append(step(costs[-1], m - 1) + self._sum(network.node[:, m]) + self._exclusion_costs(m))
        nodes = np.empty((network.objects, network.frames), dtype=np.int64)
        last = costs[-1] + self._sum(network.sink)
        nodes[:, -1] = np.unravel_index(int(last.argmin()), last.shape)
        for m in range(network.frames - 2, -1, -1):
            arriving = costs[m] + self._into(m, nodes[:, m + 1])
            nodes[:, m] = np.unravel_index(int(arriving.argmin()), arriving.shape)
        return nodes

    def _sum(self, single: Floats) -> Floats:
        """Add costs of single objects (n, S) over joint states."""
        objects = len(single)
        total = np.zeros((1,) * objects)
        for n in range(objects):
            total = total + single[n].reshape([-1 if axis == n else 1 for axis in range(objects)])
        return total

    def _exclusion_costs(self, frame: int) -> Floats:
        """Return infinity for conflicting joint states, else 0."""
        network = self._network
        objects, places = network.objects, network.max_places
        costs = np.zeros((places + 1,) * objects)
        for a in range(objects):
            for b in range(a + 1, objects):
                excluded = self._pair_exclusions(frame, a, b)
                axes = [axis for axis in range(objects) if axis not in {a, b}]
                costs = costs + np.where(np.expand_dims(excluded, axes), np.inf, 0.0)
        return costs

    def _pair_exclusions(self, frame: int, first: int, second: int) -> Bools:
        network = self._network
        places, sets = network.max_places, network.sets
        excluded = np.zeros((places + 1, places + 1), dtype=np.bool_)
        rows = slice(sets[first] * places, (sets[first] + 1) * places)
        columns = slice(sets[second] * places, (sets[second] + 1) * places)
        excluded[:places, :places] = self._exclusions[frame, rows, columns]
        return excluded

    def _step(self, costs: Floats, step: int) -> Floats:
        """Advance one frame, one object after another."""
        network = self._network
        for n in range(network.objects):
            pair = network.pair[network.pair_sets[n], step]
            ahead = np.moveaxis(costs, n, -1)[..., :, None] + pair
            costs = np.moveaxis(ahead.min(axis=-2), -1, n)
        return costs

    def _step_with_layout(self, costs: Floats, step: int) -> Floats:
        """Advance one frame for all objects together."""
        arriving = np.empty(costs.shape)
        for target in np.ndindex(costs.shape):
            arriving[target] = (costs + self._into(step, np.array(target))).min()
        return arriving

    def _into(self, step: int, target: Ints) -> Floats:
        """Return the costs of the arcs from every joint state into one, n axes."""
        network = self._network
        sets = network.sets
        total = self._sum(network.pair[network.pair_sets, step, :, target])
        if not network.layout:
            return total
        moves = network.locations[sets, step + 1, target][:, None] - network.locations[sets, step]
        objects = network.objects
        for a in range(objects):
            for b in range(a + 1, objects):
                change = np.abs(moves[a][:, None] - moves[b][None]).sum(axis=2)
                axes = [axis for axis in range(objects) if axis not in {a, b}]
                total = total + network.layout * np.expand_dims(change, axes)
        return total
