"""Particles drawn anew by their weights, where few of them count (Kitagawa 1996; Liu, Chen 1998)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats

Places = NDArray[np.intp]


def drawn(rng: np.random.Generator, weights: Floats) -> Places:
    """Draw as many particles as there are by their weights `(P,)`, which sum to 1: which ones, `(P,)`."""
    count = len(weights)
    # Systematic: one draw for all.
    marks = (rng.random() + np.arange(count)) / count
    return np.minimum(np.searchsorted(np.cumsum(weights), marks), count - 1)


def drawn_anew(rng: np.random.Generator, states: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Give the particles `(P, S)` and weights `(P,)` to go on with: others where fewer than half count."""
    count = len(weights)
    if 1.0 / float(np.square(weights).sum()) >= count / 2:
        return states, weights
    return states[drawn(rng, weights)], np.full(count, 1.0 / count)
