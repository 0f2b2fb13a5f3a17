"""The layout term's duals: forces between pairs of objects, and what they make of the costs of nodes."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.network import Network
from tracking.solvers.steps import Steps


def with_pulls(node: Floats, where: Floats, pulls: Floats) -> Floats:
    """Give the costs of nodes `node` (n, M, S) at `where` (n, M, S, 4) with what moves earn.

    `pulls` (n, M - 1, 4) is what a move by a pixel earns.
    """
    inward = np.zeros((*node.shape[:2], BOX_SIDES))
    inward[:, 1:] -= pulls
    inward[:, :-1] += pulls
    return np.asarray(node + (where @ inward[:, :, :, None])[:, :, :, 0])


class LayoutForces:
    """Forces within [-μ, μ] on the difference of two objects' moves, climbing; 0 at first."""

    def __init__(self, network: Network) -> None:
        count = network.objects if network.layout else 0
        self._objects = network.objects
        self._pairs = np.array(list(combinations(range(count), 2)), dtype=np.int64).reshape(-1, 2)
        self._forces = np.zeros((len(self._pairs), network.frames - 1, BOX_SIDES))
        self._most = network.layout
        self._steps = Steps()

    def pulls(self) -> Floats:
        """Give what a move by a pixel earns each object, (n, M - 1, 4)."""
        pulls = np.zeros((self._objects, *self._forces.shape[1:]))
        np.add.at(pulls, self._pairs[:, 0], self._forces)
        np.add.at(pulls, self._pairs[:, 1], -self._forces)
        return pulls

    def climb(self, where: Floats, length: float) -> bool:
        """Step by `length` of the largest force, for objects at `where` (n, M, 4); False: all in step."""
        slope = self._slope(where)
        if not slope.any():
            return False
        self._forces += length * self._most * self._steps.along(slope)
        np.clip(self._forces, -self._most, self._most, out=self._forces)
        return True

    def _slope(self, where: Floats) -> Floats:
        """Give how much less the first of a pair moves than the second."""
        moves: Floats = np.diff(where, axis=1)
        first, second = self._pairs.T
        return np.asarray(moves[second] - moves[first])
