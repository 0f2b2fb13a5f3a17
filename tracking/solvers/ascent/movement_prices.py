"""Prices on movements: the dual of the layout term, a function of each object's movement.

μ |a - b| for the movements a and b of two objects is at least φ(a) - φ(b) for every function φ whose slopes
are within [-μ, μ]. So each object can pay the sum of its functions for its own movement, and the cheapest
paths of all objects at these prices prove a bound. Linear functions give that of the program in II.D, in
which a mixture of paths to the left and to the right moves by its mean, which costs nothing. Here slopes
differ between `cells` of the movement, so that the term is paid on each path of a mixture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.network import Network
from tracking.solvers.objective import Ints
from tracking.solvers.sparse_trellis import SparseTrellis

Slopes = NDArray[np.floating[Any]]

_LEAST_MOVED = 1e-6
"""Pixels below which movements are none: arithmetic with the smallest numbers is slow."""

_CELL_ENDS = np.array([0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.28])
"""Ends of the cells of positive movements, in heights of a box; the last cell has none."""

_FIRST_LEAP_CELL = 5
"""The cells from this one on are those of leaps: nobody walks .32 heights in a frame."""


@dataclass(frozen=True, slots=True, eq=False)
class MovementCells:
    """Cells that the movements of a side of a box are divided into, and the lengths of their parts.

    Attributes:
        height: the median height of the boxes, pixels.
        edges: (C + 1,) ascending, pixels per frame; one of them is 0, the first and the last are infinite.
    """

    height: float
    edges: Floats

    @classmethod
    def of(cls, network: Network) -> MovementCells:
        """Return the cells for the boxes of a network."""
        boxes = network.boxes[network.present]
        height = float(np.median(boxes[:, 3] - boxes[:, 1])) if len(boxes) else 1.0
        ends = max(height, 1.0) * _CELL_ENDS
        return cls(max(height, 1.0), np.concatenate([[-np.inf], -ends[::-1], [0.0], ends, [np.inf]]))

    @property
    def count(self) -> int:
        """The number C of cells of a side."""
        return len(self.edges) - 1

    @property
    def leap(self) -> float:
        """The pixels per frame beyond which movements go through cells of leaps."""
        return float(self.edges[self.count // 2 + _FIRST_LEAP_CELL])

    def are_leaps(self) -> NDArray[np.bool_]:
        """Return which of the cells of a box are those of leaps, (4 C,)."""
        outside = (self.edges[:-1] >= self.leap) | (self.edges[1:] <= -self.leap)
        return np.tile(outside, BOX_SIDES)

    def lengths(self, movements: Slopes) -> Floats:
        """Return how far movements (..., 4) go through each cell, (..., 4 C), negative to the left and up.

        The sum over a side's cells is its movement.
        """
        lower, upper = self.edges[:-1], self.edges[1:]
        through = np.clip(movements[..., None], lower, upper) - np.clip(0.0, lower, upper)
        return np.asarray(through.reshape(*movements.shape[:-1], BOX_SIDES * self.count), dtype=np.float64)

    def widths(self) -> Floats:
        """Return the widths of all cells of a box, (4 C,); those at the ends are finite here."""
        ends = np.nan_to_num(self.edges, posinf=2.0 * self.edges[-2], neginf=2.0 * self.edges[1])
        return np.tile(np.diff(ends), BOX_SIDES)


def slopes_from_tensions(tensions: Slopes, limits: Slopes) -> Slopes:
    """Return the slope of each object's price in each cell, (n, M - 1, 4 C): valid ones for any tensions.

    Two objects pull each other by the difference of their tensions, by the limits (M - 1, 4 C) of step and
    cell at most: the slope of an object is the sum over all others.
    """
    slopes = np.zeros_like(tensions)
    for owner in range(1, len(tensions)):
        pulls = np.clip(tensions[owner] - tensions[:owner], -1.0, 1.0)
        slopes[owner] += pulls.sum(axis=0)
        slopes[:owner] -= pulls
    return slopes * limits.astype(slopes.dtype)


@dataclass(frozen=True, slots=True, eq=False)
class MovementPrices:
    """The prices of arcs of a trellis for their movements.

    Attributes:
        movements: (4, P, E) pixels.
        places: (4, P, E) where the slope at each of them is in the slopes of an object, (M - 1, 4, C).
    """

    cells: MovementCells
    trellis: SparseTrellis
    movements: Floats
    places: Ints

    @classmethod
    def of(cls, cells: MovementCells, trellis: SparseTrellis, locations: Floats) -> MovementPrices:
        """Return the prices of all arcs between locations (P, M, S, 4), pixels."""
        movements = np.ascontiguousarray(np.moveaxis(trellis.movements(locations), 2, 0))
        sides = np.arange(BOX_SIDES)[:, None, None]
        places = np.searchsorted(cells.edges[1:-1], movements, side="right")
        places += cells.count * (BOX_SIDES * trellis.step + sides)
        return cls(cells, trellis, movements, places)

    def select(self, kept: NDArray[np.bool_]) -> MovementPrices:
        """Return those of the arcs where `kept` (E,) is true."""
        if kept.all():
            return self
        index = np.flatnonzero(kept)
        movements, places = self.movements.take(index, axis=2), self.places.take(index, axis=2)
        return MovementPrices(self.cells, self.trellis.select(kept), movements, places)

    def of_slopes(self, slopes: Slopes) -> Floats:
        """Return the price of each arc, (n, E), from the slopes (n, M - 1, 4 C)."""
        count = self.cells.count
        by_side = slopes.reshape(*slopes.shape[:2], BOX_SIDES, count)
        # Within a cell a price is a line: its slope, and where it would cross zero.
        ends = self.cells.edges[1:-1]
        widths = np.diff(self.cells.edges)[1:-1]
        at_ends = np.concatenate(
            [np.zeros((*by_side.shape[:3], 1)), np.cumsum(by_side[..., 1:-1] * widths, axis=3)], axis=3
        )
        at_ends -= at_ends[..., [count // 2 - 1]]
        offsets = at_ends[..., np.maximum(np.arange(count) - 1, 0)]
        offsets -= by_side * ends[np.maximum(np.arange(count) - 1, 0)]
        offsets, flat = offsets.reshape(len(slopes), -1), slopes.reshape(len(slopes), -1)
        prices = np.zeros((len(slopes), len(self.trellis)))
        shared = self.movements.shape[1] == 1
        for movements, places in zip(self.movements, self.places, strict=True):
            for p, own in enumerate(places):
                owners = slice(None) if shared else slice(p, p + 1)
                prices[owners] += flat[owners].take(own, axis=1) * movements[p]
                prices[owners] += offsets[owners].take(own, axis=1)
        return prices


class MovementLengths:
    """How far the movements of arcs go through each cell, (P, E, 4 C) in single precision."""

    def __init__(self, arcs: MovementPrices) -> None:
        self._steps = arcs.trellis.steps
        movements = np.moveaxis(arcs.movements, 0, 2).astype(np.float32)
        self._lengths: Slopes = arcs.cells.lengths(movements).astype(np.float32)

    def prices(self, slopes: Slopes) -> Slopes:
        """Return the price of each arc, (n, E), from the slopes (n, M - 1, 4 C) in single precision."""
        prices = np.empty((len(slopes), self._lengths.shape[1]), dtype=np.float32)
        for p, own in enumerate(self._lengths):
            owners = slice(None) if len(self._lengths) == 1 else slice(p, p + 1)
            for m, step in enumerate(self._steps):
                prices[owners, step.span] = slopes[owners, m] @ own[step.span].T
        return prices

    def moved(self, shares: Slopes) -> Slopes:
        """Return how far objects move through each cell, (n, M - 1, 4 C), at shares of arcs (n, E)."""
        moved = np.empty((len(shares), len(self._steps), self._lengths.shape[2]), dtype=np.float32)
        for p, own in enumerate(self._lengths):
            owners = slice(None) if len(self._lengths) == 1 else slice(p, p + 1)
            for m, step in enumerate(self._steps):
                moved[owners, m] = shares[owners, step.span] @ own[step.span]
        moved[np.abs(moved) < _LEAST_MOVED] = 0.0
        return moved
