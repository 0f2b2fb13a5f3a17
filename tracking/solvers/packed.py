"""Some states of every object and frame, packed: a trellis is quick where few states of it matter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.conflicts import Bools
from tracking.solvers.objective import Ints
from tracking.solvers.viterbi import Trellis


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """W slots for each object and frame, in the order of their states; empty slots are the last.

    Attributes:
        index: (n, M, W) the state in each slot; any in an empty one.
        filled: (n, M, W) False where a slot is empty.
    """

    index: Ints
    filled: Bools

    @classmethod
    def of(cls, kept: Bools) -> Packed:
        """Keep the states where `kept` (n, M, S) is true."""
        counts = kept.sum(axis=2)
        width = int(counts.max(initial=1))
        index = np.argsort(~kept, axis=2, kind="stable")[:, :, :width]
        return cls(index, np.arange(width) < counts[:, :, None])

    @classmethod
    def cheapest(cls, costs: Floats, most: int) -> Packed:
        """Keep the `most` states of an object and frame that cost least by `costs` (n, M, S)."""
        if most < costs.shape[2]:
            index = np.sort(np.argpartition(costs, most - 1, axis=2)[:, :, :most], axis=2)
        else:
            index = np.broadcast_to(np.arange(costs.shape[2]), costs.shape)
        return cls(index, np.ones(index.shape, dtype=np.bool_))

    def states(self, values: Floats, empty: float) -> Floats:
        """Give values of states, (n, M, S, ...) to (n, M, W, ...); empty slots have `empty`."""
        objects, frames = self.index.shape[:2]
        packed = values[np.arange(objects)[:, None, None], np.arange(frames)[:, None], self.index]
        packed[~self.filled] = empty
        return packed

    def pairs(self, values: Floats) -> Floats:
        """Give values of arcs, (n or 1, M - 1, S, S) to (n, M - 1, W, W)."""
        objects, frames = self.index.shape[:2]
        sets = np.arange(objects) if len(values) == objects else np.zeros(objects, dtype=np.int64)
        step = np.arange(frames - 1)[:, None, None]
        origin, target = self.index[:, :-1, :, None], self.index[:, 1:, None, :]
        return np.asarray(values[sets[:, None, None, None], step, origin, target])

    def trellis(self, trellis: Trellis) -> Trellis:
        """Give the trellis of the states kept."""
        each = np.arange(len(self.index))[:, None]
        return Trellis(
            trellis.source[each, self.index[:, 0]],
            self.states(trellis.node, np.inf),
            self.pairs(trellis.pair),
            trellis.sink[each, self.index[:, -1]],
        )

    def named(self, slots: Ints) -> Ints:
        """Give the states in slots, both (n, M)."""
        return np.asarray(np.take_along_axis(self.index, slots[:, :, None], axis=2)[:, :, 0])
