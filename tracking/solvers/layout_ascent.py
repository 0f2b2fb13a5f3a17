"""A quick first guess at the duals of the layout term, so that few arcs need enter later.

Projected subgradient ascent of the bound, each force by steps of its own size (as Adam takes them): the
forces between pairs of objects, within [-μ, μ], pull the cheapest paths into step. It proves nothing that
counts; the search that starts from it does.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.network import Network
from tracking.solvers.objective import Ints
from tracking.solvers.packed import Packed
from tracking.solvers.viterbi import Marginals, Trellis, best_paths

_STEPS = 40
_KEPT = 8
"""Of the last paths met: they are near those of the optimum."""

_FIRST, _SHORTER = 0.2, 0.95
"""Length of the first step as a share of μ, and of each step as a share of the one before."""

_MEMORY, _MEMORY_OF_SIZE = 0.6, 0.9
"""Shares of the former direction, and of the former typical size of a slope, in the next one."""

_STATES = 12
"""States of a frame and object that the guess looks at: the cheapest without forces."""

_STILL = 1e-3
"""Pixels: forces between objects that move alike stay."""


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """Forces as `pulls` (n, M - 1, 4) on moves, and the last `paths` met, (objects * kept, M)."""

    pulls: Floats
    paths: Ints
    owners: Ints


def with_pulls(network: Network, node: Floats, pulls: Floats) -> Floats:
    """Give the costs of nodes `node` (n, M, S) with what moves earn by `pulls` (n, M - 1, 4)."""
    return _pulled(node, network.locations[network.sets], pulls)


def _pulled(node: Floats, where: Floats, pulls: Floats) -> Floats:
    """Give node costs under pulls; `where` (n, M, S, 4) are the states' locations."""
    inward = np.zeros((*node.shape[:2], BOX_SIDES))
    inward[:, 1:] -= pulls
    inward[:, :-1] += pulls
    return np.asarray(node + (where @ inward[:, :, :, None])[:, :, :, 0])


def guessed(network: Network) -> Guess:
    """Guess the forces in a network with layout term."""
    pairs = np.array(list(combinations(range(network.objects), 2)), dtype=np.int64).reshape(-1, 2)
    forces = np.zeros((len(pairs), network.frames - 1, BOX_SIDES))
    way, size, best = np.zeros_like(forces), np.zeros_like(forces), -np.inf
    trellis, best_pulls = Trellis.of(network), _pulls(network, pairs, forces)
    packed = Packed.cheapest(Marginals.of(trellis).through, _STATES)
    trellis, where = packed.trellis(trellis), packed.states(network.locations[network.sets], 0.0)
    each, frames = np.indices((network.objects, network.frames))
    met: list[Ints] = []
    for step in range(_STEPS):
        pulls = _pulls(network, pairs, forces)
        paths = best_paths(trellis.with_node(_pulled(trellis.node, where, pulls)))
        met = [*met, packed.named(paths.nodes)][-_KEPT:]
        bound = float(paths.costs.sum())
        if bound > best:
            best, best_pulls = bound, pulls
        slope = _slope(pairs, where[each, frames, paths.nodes])
        if not slope.any():
            break
        way = _MEMORY * way + (1.0 - _MEMORY) * slope
        size = _MEMORY_OF_SIZE * size + (1.0 - _MEMORY_OF_SIZE) * slope**2
        direction = way / (1.0 - _MEMORY ** (step + 1))
        typical = np.sqrt(size / (1.0 - _MEMORY_OF_SIZE ** (step + 1)))
        length = network.layout * _FIRST * _SHORTER**step
        forces += length * direction / (typical + _STILL)
        np.clip(forces, -network.layout, network.layout, out=forces)
    owners = np.tile(np.arange(network.objects), len(met))
    return Guess(best_pulls, np.concatenate(met), owners)


def _pulls(network: Network, pairs: Ints, forces: Floats) -> Floats:
    pulls = np.zeros((network.objects, *forces.shape[1:]))
    np.add.at(pulls, pairs[:, 0], forces)
    np.add.at(pulls, pairs[:, 1], -forces)
    return pulls


def _slope(pairs: Ints, where: Floats) -> Floats:
    """Give the subgradient of the bound: how much less the first of a pair moves than the second."""
    moves = np.diff(where, axis=1)
    return np.asarray(moves[pairs[:, 1]] - moves[pairs[:, 0]])
