"""Shares of all paths instead of the cheapest one: a path of cost c counts exp(-c / temperature).

They change smoothly with the costs, so that prices can follow them in long steps, where the cheapest path
jumps. They are of single precision, and approximate where a path has almost no share: they show a direction,
and prove nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Singles = NDArray[np.float32]

_LEAST_EXPONENT = np.float32(-50.0)
"""Products with shares stay above the smallest normal number, below which arithmetic is slow."""

_LEAST_SHARE = np.float32(1e-9)
"""Added to the share of each state, so that a state can follow that no likely one leads to."""

_LEAST_ARC = np.float32(1e-12)
"""Added to the share of each arc, for the same reason."""


def soft_paths(costs: Singles, temperature: float) -> Singles:
    """Turn the costs of arcs between frames, (n, M - 1, S, S), into their shares, in place.

    The shares of an object's arcs of a step sum to 1. The costs of arcs include nodes, source and sink.
    """
    costs -= costs.min(axis=(2, 3), keepdims=True)
    costs *= np.float32(-1.0 / temperature)
    np.maximum(costs, _LEAST_EXPONENT, out=costs)
    shares = np.exp(costs, out=costs)
    objects, steps, states, _ = shares.shape
    ahead = np.empty((steps, objects, states, 1), dtype=np.float32)
    ahead[-1] = 1.0
    for m in range(steps - 1, 0, -1):
        ahead[m - 1] = _normalized(shares[:, m] @ ahead[m])
    behind = np.ones((objects, 1, states), dtype=np.float32)
    for m in range(steps):
        arcs = shares[:, m]
        through = _normalized(behind @ arcs)
        arcs *= np.swapaxes(behind, 1, 2)
        arcs *= np.swapaxes(ahead[m], 1, 2)
        arcs /= arcs.sum(axis=(1, 2), keepdims=True)
        behind = through
    shares += _LEAST_ARC
    return shares


def node_shares(arcs: Singles) -> Singles:
    """Return the shares of the nodes, (n, M, S)."""
    return np.concatenate([arcs[:, :1].sum(axis=3), arcs.sum(axis=2)], axis=1)


def _normalized(shares: Singles) -> Singles:
    return np.asarray(shares / shares.sum(axis=(1, 2), keepdims=True) + _LEAST_SHARE)
