"""Shares of all paths instead of the cheapest one: a path of cost c counts exp(-c / temperature).

They change smoothly with the costs, so that prices can follow them in long steps, where the cheapest path
jumps. They are of single precision, and approximate where a path has almost no share: they show a direction,
and prove nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.solvers.sparse_trellis import SparseTrellis

Singles = NDArray[np.float32]

_LEAST_EXPONENT = np.float32(-50.0)
"""Products with shares stay above the smallest normal number, below which arithmetic is slow."""

_LEAST_SHARE = np.float32(1e-9)
"""Added to the share of each state, so that a state can follow that no likely one leads to."""

_LEAST_ARC = np.float32(1e-12)
"""Added to the share of each arc, for the same reason."""


@dataclass(frozen=True, slots=True, eq=False)
class SoftPaths:
    """Shares of the paths of each object.

    Attributes:
        arcs: (n, E) the shares of arcs, which sum to 1 in each step.
        nodes: (n, M, S) those of states.
    """

    arcs: Singles
    nodes: Singles


def soft_paths(trellis: SparseTrellis, costs: Singles, temperature: float) -> SoftPaths:
    """Compute the shares from the costs of arcs, (n, E), which are overwritten."""
    for step in trellis.steps:
        costs[:, step.span] -= costs[:, step.span].min(axis=1, keepdims=True)
    costs *= np.float32(-1.0 / temperature)
    np.maximum(costs, _LEAST_EXPONENT, out=costs)
    shares = np.exp(costs, out=costs)
    nodes = np.zeros((len(shares), len(trellis.steps) + 1, trellis.states), dtype=np.float32)
    ahead = _shares_ahead(trellis, shares, np.zeros_like(nodes))
    behind = np.ones_like(nodes[:, 0])
    for m, step in enumerate(trellis.steps):
        arcs, entering = shares[:, step.span], step.entering
        arcs *= behind[:, step.origin]
        through = _normalized(np.add.reduceat(arcs, entering.starts, axis=1))
        arcs *= ahead[:, m + 1, step.target]
        arcs /= arcs.sum(axis=1, keepdims=True)
        nodes[:, m + 1, entering.states] = np.add.reduceat(arcs, entering.starts, axis=1)
        behind = np.zeros_like(behind)
        behind[:, entering.states] = through
    first = trellis.steps[0]
    leaving = shares[:, first.span][:, first.order]
    nodes[:, 0, first.leaving.states] = np.add.reduceat(leaving, first.leaving.starts, axis=1)
    shares += _LEAST_ARC
    return SoftPaths(shares, nodes)


def _shares_ahead(trellis: SparseTrellis, shares: Singles, ahead: Singles) -> Singles:
    """Fill `ahead` (n, M, S) with the shares of the paths from each state on, up to a factor."""
    ahead[:, -1] = 1.0
    ordered = shares[:, trellis.by_origin]
    for m in range(len(trellis.steps) - 1, 0, -1):
        step = trellis.steps[m]
        arcs = ordered[:, step.span]
        arcs *= ahead[:, m + 1, step.target[step.order]]
        ahead[:, m, step.leaving.states] = _normalized(np.add.reduceat(arcs, step.leaving.starts, axis=1))
    return ahead


def _normalized(shares: Singles) -> Singles:
    return np.asarray(shares / shares.sum(axis=1, keepdims=True) + _LEAST_SHARE)
