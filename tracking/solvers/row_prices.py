"""The conflict rows' duals: prices of going through them, and what they make of the costs of nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats
from tracking.solvers.conflict_finder import ConflictRow
from tracking.solvers.objective import Ints
from tracking.solvers.packed import Packed
from tracking.solvers.steps import Steps


class RowPrices:
    """Prices, never negative, of conflict rows on a packed trellis, climbing; rows join at price 0."""

    def __init__(self, packed: Packed) -> None:
        self._packed = packed
        objects, self._frames, width = packed.index.shape
        self._members = np.zeros((0, objects, width))
        self._frame = np.empty(0, dtype=np.int64)
        self._steps = Steps()
        self.rows: list[ConflictRow] = []
        self.prices = np.empty(0)

    def join(self, rows: Sequence[ConflictRow]) -> None:
        """Let more rows have a price."""
        if not rows:
            return
        each = np.arange(self._members.shape[1])[:, None]
        members = [row.members[each, self._packed.index[:, row.frame]] for row in rows]
        self._members = np.concatenate([self._members, np.array(members, dtype=np.float64)])
        self._frame = np.concatenate([self._frame, [row.frame for row in rows]])
        self.prices = np.concatenate([self.prices, np.zeros(len(rows))])
        self.rows.extend(rows)

    def on(self, node: Floats) -> Floats:
        """Give the costs of nodes, `node` (n, M, W), with the prices."""
        if not len(self.prices):
            return node
        at = (self._frame == np.arange(self._frames)[:, None]) * self.prices
        added = at @ self._members.reshape(len(self.prices), -1)
        return np.asarray(node + np.swapaxes(added.reshape(self._frames, *self._members.shape[1:]), 0, 1))

    def climb(self, slots: Ints, length: float) -> bool:
        """Step by `length` for objects in `slots` (n, M); False: no row is broken and none costs."""
        if not len(self.prices):
            return False
        rows, each = np.arange(len(self.prices))[:, None], np.arange(len(slots))
        slope = self._members[rows, each, slots[:, self._frame].T].sum(axis=1) - 1.0
        slope[(slope < 0.0) & (self.prices == 0.0)] = 0.0
        if not slope.any():
            return False
        self.prices = np.maximum(0.0, self.prices + length * self._steps.along(slope))
        return True
