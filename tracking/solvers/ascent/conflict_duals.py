"""Prices of conflict rows, as they rise and fall in a dual ascent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats
from tracking.solvers.ascent.adam import AdamSteps
from tracking.solvers.cutting_planes import ConflictRow
from tracking.solvers.objective import Ints
from tracking.solvers.viterbi import PrunedStates


class ConflictDuals:
    """Prices of conflict rows on a pruned trellis, not negative; new rows start at 0."""

    def __init__(self, packed: PrunedStates, steps: AdamSteps) -> None:
        self._packed, self._steps = packed, steps
        objects, self._frames, width = packed.index.shape
        self._members = np.zeros((0, objects, width))
        self._frame = np.empty(0, dtype=np.int64)
        self.rows: list[ConflictRow] = []
        self.prices = np.empty(0)

    def add_rows(self, rows: Sequence[ConflictRow], prices: Floats | None = None) -> None:
        """Add rows to be priced, at `prices` (R,) if they are known."""
        if not rows:
            return
        each = np.arange(self._members.shape[1])[:, None]
        members = [row.members[each, self._packed.index[:, row.frame]] for row in rows]
        self._members = np.concatenate([self._members, np.array(members, dtype=np.float64)])
        self._frame = np.concatenate([self._frame, [row.frame for row in rows]])
        self.prices = np.concatenate([self.prices, np.zeros(len(rows)) if prices is None else prices])
        self.rows.extend(rows)

    def add_to(self, node: Floats) -> Floats:
        """Return node costs `node` (n, M, W) with the prices."""
        return node + self.price_nodes(self.prices) if len(self.prices) else node

    def price_nodes(self, prices: Floats) -> Floats:
        """Return what each node pays, (n, M, W), at prices (R,) of the first R rows."""
        count = len(prices)
        frame_prices = (self._frame[:count] == np.arange(self._frames)[:, None]) * prices
        return np.swapaxes(np.tensordot(frame_prices, self._members[:count], axes=1), 0, 1)

    def loads_of_paths(self, slots: Ints) -> Floats:
        """Return how many of the objects in `slots` (n, M) are in each row, (R,)."""
        rows, each = np.arange(len(self.prices))[:, None], np.arange(len(slots))
        return np.asarray(self._members[rows, each, slots[:, self._frame].T].sum(axis=1))

    def loads_of_shares(self, shares: Floats) -> Floats:
        """Return how much of the objects, whose shares in each slot are (n, M, W), is in each row, (R,)."""
        return np.asarray(np.einsum("rnw,nrw->r", self._members, shares[:, self._frame]))

    def ascend(self, loads: Floats, length: float) -> bool:
        """Step by `length` for the `loads` of rows; False: no row is violated or has a price."""
        slope = loads - 1.0
        slope[(slope < 0.0) & (self.prices == 0.0)] = 0.0
        if not slope.any():
            return False
        self.prices = np.maximum(0.0, self.prices + length * self._steps.step(slope))
        return True


def typical_price(through: Floats, least: Floats) -> float:
    """Return the mean excess cost of the second best state per frame, from costs (n, M, W) and (n,)."""
    if through.shape[2] == 1:
        return 0.0
    excess = np.partition(through, 1, axis=2)[:, :, 1] - least[:, None]
    return float(excess[np.isfinite(excess)].mean()) if np.isfinite(excess).any() else 0.0
