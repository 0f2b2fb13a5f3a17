"""A quick first guess at the duals of the layout term, so that few arcs need enter later.

Projected subgradient ascent of the bound: the forces between pairs of objects, within [-μ, μ], pull the
cheapest paths into step. It proves nothing that counts; the search that starts from it does.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.network import Network
from tracking.solvers.objective import Ints, locations_at
from tracking.solvers.viterbi import Paths, Trellis, best_paths

_STEPS = 60
_KEPT = 8
"""Of the last paths met: they are near those of the optimum."""

_MEMORY = 0.6
"""Share of the former direction in the next one."""

_PATIENCE, _SHORTER = 5, 0.6
"""After so many steps without a better bound, steps get shorter by this factor."""


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """Forces as `pulls` (n, M - 1, 4) on moves, and the last `paths` met, (objects * kept, M)."""

    pulls: Floats
    paths: Ints
    owners: Ints


def with_pulls(network: Network, node: Floats, pulls: Floats) -> Floats:
    """Give the costs of nodes `node` (n, M, S) with what moves earn by `pulls` (n, M - 1, 4)."""
    where = network.locations[network.sets]
    pulled = node.copy()
    pulled[:, 1:] -= np.einsum("nml,nmsl->nms", pulls, where[:, 1:])
    pulled[:, :-1] += np.einsum("nml,nmsl->nms", pulls, where[:, :-1])
    return pulled


def guessed(network: Network, attained: float) -> Guess:
    """Guess the forces in a network with layout term; `attained` is the cost of some states."""
    pairs = np.array(list(combinations(range(network.objects), 2)), dtype=np.int64).reshape(-1, 2)
    forces = np.zeros((len(pairs), network.frames - 1, BOX_SIDES))
    way, length, waited, best = np.zeros_like(forces), 1.0, 0, -np.inf
    trellis, best_pulls = Trellis.of(network), _pulls(network, pairs, forces)
    met: list[Ints] = []
    for _ in range(_STEPS):
        pulls = _pulls(network, pairs, forces)
        paths = best_paths(trellis.with_node(with_pulls(network, network.node, pulls)))
        met = [*met, paths.nodes][-_KEPT:]
        bound, waited = float(paths.costs.sum()), waited + 1
        if bound > best:
            best, best_pulls, waited = bound, pulls, 0
        elif waited > _PATIENCE:
            length, waited = length * _SHORTER, 0
        way = _MEMORY * way + (1.0 - _MEMORY) * _slope(network, pairs, paths)
        steepness = float((way**2).sum())
        if steepness == 0.0 or attained <= bound:
            break
        step = length * (attained - bound) / steepness
        forces = np.clip(forces + step * way, -network.layout, network.layout)
    owners = np.tile(np.arange(network.objects), len(met))
    return Guess(best_pulls, np.concatenate(met), owners)


def _pulls(network: Network, pairs: Ints, forces: Floats) -> Floats:
    pulls = np.zeros((network.objects, *forces.shape[1:]))
    np.add.at(pulls, pairs[:, 0], forces)
    np.add.at(pulls, pairs[:, 1], -forces)
    return pulls


def _slope(network: Network, pairs: Ints, paths: Paths) -> Floats:
    """Give the subgradient of the bound: how much less the first of a pair moves than the second."""
    moves = np.diff(locations_at(network, paths.nodes), axis=1)
    return np.asarray(moves[pairs[:, 1]] - moves[pairs[:, 0]])
