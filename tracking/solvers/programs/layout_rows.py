"""The squared layout term in a program of arcs: movements δ of objects, and differences of two movements."""

from __future__ import annotations

from itertools import combinations

import highspy
import numpy as np
from scipy import sparse

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.network import Network
from tracking.solvers.objective import Ints


class LayoutConstraints:
    """Columns δ and p and their rows; the network has at least two frames. The term is μ p².

    A row per object, step and side defines δ as the movement of the flow; a row per pair of objects, step and
    side defines p as the difference of two movements. The duals of the movements are sums of those of the
    pairs: a potential on the nodes, so that Viterbi can price it.

    Attributes:
        squares: the columns p, which are squared, at the weight μ.
    """

    def __init__(self, network: Network, highs: highspy.Highs) -> None:
        self._network = network
        self._pairs = np.array(list(combinations(range(network.objects), 2)), dtype=np.int64).reshape(-1, 2)
        steps = (network.frames - 1, BOX_SIDES)
        moves, differences = (network.objects, *steps), (len(self._pairs), *steps)
        first = highs.getNumRow()
        count = int(np.prod(moves)) + int(np.prod(differences))
        zeros = np.zeros(count)
        none = np.empty(0, dtype=np.int32)
        highs.addRows(count, zeros, zeros, 0, np.zeros(count, dtype=np.int32), none, np.empty(0))
        rows = np.arange(first, first + count)
        self._moves = rows[: int(np.prod(moves))].reshape(moves)
        self._differences = rows[int(np.prod(moves)) :].reshape(differences)
        self._add_columns(highs)

    def _add_columns(self, highs: highspy.Highs) -> None:
        """Add δ and p, unbounded and without linear cost."""
        moves, differences, first_row = self._moves, self._differences, int(self._moves.flat[0])
        count = moves.size + differences.size
        delta = np.arange(moves.size).reshape(moves.shape)
        apart = np.arange(moves.size, count).reshape(differences.shape)
        a, b = self._pairs.T
        entries = [
            (moves, delta, -1.0),
            (differences, delta[a], 1.0),
            (differences, delta[b], -1.0),
            (differences, apart, -1.0),
        ]
        row = np.concatenate([rows.ravel() - first_row for rows, _, _ in entries])
        column = np.concatenate([columns.ravel() for _, columns, _ in entries])
        value = np.concatenate([np.full(rows.size, sign) for rows, _, sign in entries])
        matrix = sparse.csc_array((value, (row, column)), shape=(count, count))
        highs.addCols(
            count,
            np.zeros(count),
            np.full(count, -np.inf),
            np.full(count, np.inf),
            matrix.nnz,
            matrix.indptr[:-1].astype(np.int32),
            (matrix.indices + first_row).astype(np.int32),
            matrix.data,
        )
        self.squares = highs.getNumCol() - count + apart.ravel()

    def entries(self, owner: Ints, step: Ints, origin: Ints, target: Ints) -> tuple[Ints, Floats]:
        """Return the rows and values, both (A, 4), of arcs from frame `step` to the next."""
        locations, sets = self._network.locations, self._network.sets[owner]
        return self._moves[owner, step], locations[sets, step + 1, target] - locations[sets, step, origin]

    def forces(self, duals: Floats) -> Floats:
        """Return each pair's duals per pixel of difference, (pairs, M - 1, 4)."""
        return np.asarray(duals[self._differences])

    def layout_prices(self, forces: Floats) -> Floats:
        """Return each object's gain per pixel of movement, (n, M - 1, 4)."""
        prices = np.zeros(self._moves.shape)
        np.add.at(prices, self._pairs[:, 0], forces)
        np.add.at(prices, self._pairs[:, 1], -forces)
        return prices

    def bound_reduction(self, forces: Floats) -> float:
        """Return the reduction of the bound by the duals: the conjugate of the square."""
        return float((forces**2).sum() / (4.0 * self._network.layout))
