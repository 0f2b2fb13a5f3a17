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

Slopes = NDArray[np.floating[Any]]

_LEAST_MOVED = 1e-6
"""Pixels below which movements are none: arithmetic with the smallest numbers is slow."""

_CELL_ENDS = 0.02 * 2.0 ** np.arange(8)
"""Ends of the cells of positive movements, in heights of a box; the last cell has none."""


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

    def lengths(self, movements: Floats) -> Floats:
        """Return how far movements (..., 4) go through each cell, (..., 4 C), negative to the left and up.

        The sum over a side's cells is its movement.
        """
        lower, upper = self.edges[:-1], self.edges[1:]
        through = np.clip(movements[..., None], lower, upper) - np.clip(0.0, lower, upper)
        return np.asarray(through.reshape(*movements.shape[:-1], BOX_SIDES * self.count))

    def widths(self) -> Floats:
        """Return the widths of all cells of a box, (4 C,); those at the ends are finite here."""
        ends = np.nan_to_num(self.edges, posinf=2.0 * self.edges[-2], neginf=2.0 * self.edges[1])
        return np.tile(np.diff(ends), BOX_SIDES)


def slopes_from_tensions(tensions: Slopes, limits: Slopes) -> Slopes:
    """Return the slope of each object's price in each cell, (n, M - 1, 4 C): valid ones for any tensions.

    Two objects pull each other by the difference of their tensions, by the step's limit (M - 1,) at most: the
    slope of an object is the sum over all others.
    """
    slopes = np.zeros_like(tensions)
    for owner in range(1, len(tensions)):
        pulls = np.clip(tensions[owner] - tensions[:owner], -1.0, 1.0)
        slopes[owner] += pulls.sum(axis=0)
        slopes[:owner] -= pulls
    return slopes * limits[:, None].astype(slopes.dtype)


class MovementLengths:
    """The lengths of the movements of all arcs: (P, M - 1, S S, 4 C), in single or double precision."""

    def __init__(self, network: Network, cells: MovementCells) -> None:
        before, after = network.locations[:, :-1, :, None], network.locations[:, 1:, None]
        sets, steps, states = network.locations[:, 1:, :, 0].shape
        self._shape = (network.objects, steps, states, states)
        self._exact: Slopes = cells.lengths(after - before).reshape(
            sets, steps, states**2, BOX_SIDES * cells.count
        )
        self._singles: Slopes = self._exact.astype(np.float32)

    def prices(self, slopes: Slopes) -> Slopes:
        """Return the price of each arc, (n, M - 1, S, S), in the precision of the slopes (n, M - 1, 4 C)."""
        lengths = self._singles if slopes.dtype == np.float32 else self._exact
        prices = np.empty((len(slopes), lengths.shape[1], lengths.shape[2]), dtype=slopes.dtype)
        for p, own in enumerate(lengths):
            owners = slice(None) if len(lengths) == 1 else slice(p, p + 1)
            for m, of_step in enumerate(own):
                prices[owners, m] = slopes[owners, m] @ of_step.T
        return prices.reshape(self._shape)

    def moved(self, arcs: Slopes) -> Slopes:
        """Return how far objects move through each cell, (n, M - 1, 4 C), at shares in single precision."""
        flat = arcs.reshape(*arcs.shape[:2], -1)
        moved = np.empty((*arcs.shape[:2], self._singles.shape[3]), dtype=np.float32)
        for p, own in enumerate(self._singles):
            owners = slice(None) if len(self._singles) == 1 else slice(p, p + 1)
            for m, of_step in enumerate(own):
                moved[owners, m] = flat[owners, m] @ of_step
        moved[np.abs(moved) < _LEAST_MOVED] = 0.0
        return moved


def hiding_tolls(network: Network) -> Floats:
    """Return what hiding and reappearing can cost on every arc beside these prices, (1, M - 1, S, S), pixels.

    Two objects that hide, or reappear, in the same step come from or go to places that do not conflict, so
    that their movements differ by the distance of these places at least. From all other movements theirs
    differ by the sizes at least that the box takes or gives. So each can be charged half of the least of
    these distances for each other object. Zero where objects do not share their observations.
    """
    places, frames = network.max_places, network.frames
    tolls = np.zeros((1, frames - 1, places + 1, places + 1))
    if not network.shared or not places:
        return tolls
    boxes, hidden = network.locations[0, :, :places], network.locations[0, :, places:]
    apart = np.abs(boxes[:, :, None] - boxes[:, None]).sum(axis=3)
    apart[network.exclusions() | ~network.present[0][:, None]] = np.inf
    nearest = np.minimum(apart.min(axis=2), np.abs(boxes - hidden).sum(axis=2))
    sizes = boxes[:, :, 2:] - boxes[:, :, :2]
    for m in range(frames - 1):
        usable = np.isfinite(network.pair[:, m, :places, :places]).any(axis=0)
        growth = (sizes[m + 1] - sizes[m][:, None])[usable]
        grown, shrunk = growth.max(axis=0, initial=0.0), (-growth).max(axis=0, initial=0.0)
        taken = np.maximum(sizes[m + 1] - grown, 0.0).sum(axis=1)
        given = np.maximum(sizes[m] - shrunk, 0.0).sum(axis=1)
        tolls[0, m, places, :places] = np.minimum(nearest[m + 1], taken)
        tolls[0, m, :places, places] = np.minimum(nearest[m], given)
    return tolls * (network.objects - 1) / 2.0
