"""The optimum of the relaxation, however it was found."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tracking.boxes import Floats
from tracking.solvers.hint import PricedRow

CLOSE = 1e-11
"""Relative distance of cost and bound at which the optimum is proven; far below the 1e-9 promised."""


@dataclass(frozen=True, slots=True, eq=False)
class Relaxed:
    """The optimum of the relaxation.

    Attributes:
        usage: y (n, M, S), how much of each object goes through each node.
        bound: its cost, as the prices prove it.
        priced: (n, M, S) the costs of nodes with the prices of conflicts and of the layout on them, at
            which the cheapest paths prove the bound.
        rounds: how often paths or arcs were priced.
        prices: the conflict rows that bind, where all objects share them.
        pulls: (n, M - 1, 4) what moves earn by the layout term; none without.
        charges: (M,) what the prices of a frame's rows take off the bound; none without layout term.
    """

    usage: Floats
    bound: float
    priced: Floats
    rounds: int
    prices: tuple[PricedRow, ...] = ()
    pulls: Floats = field(default_factory=lambda: np.empty(0))
    charges: Floats = field(default_factory=lambda: np.empty(0))
