"""Sparse rows and columns put together block by block."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from tracking.boxes import Floats
from tracking.solvers.highs import LinearProgram


class Assembly:
    """Collects the columns and rows of a program; entries of one place add up."""

    def __init__(self) -> None:
        self._costs: list[Floats] = []
        self._lower: list[Floats] = []
        self._row_lower: list[Floats] = []
        self._row_upper: list[Floats] = []
        self._entries: list[tuple[NDArray[np.int64], NDArray[np.int64], Floats]] = []
        self._columns = 0
        self._rows = 0

    def columns(self, costs: Floats, lower: float = 0.0) -> NDArray[np.int64]:
        """Add columns without upper bound; give their numbers."""
        first, self._columns = self._columns, self._columns + len(costs)
        self._costs.append(costs)
        self._lower.append(np.full(len(costs), lower))
        return np.arange(first, self._columns)

    def rows(self, count: int, lower: float, upper: float) -> NDArray[np.int64]:
        """Add `count` empty rows; give their numbers."""
        first, self._rows = self._rows, self._rows + count
        self._row_lower.append(np.full(count, lower))
        self._row_upper.append(np.full(count, upper))
        return np.arange(first, self._rows)

    def put(self, rows: ArrayLike, columns: ArrayLike, values: ArrayLike) -> None:
        """Put values into the matrix; the three broadcast."""
        at_row, at_column, value = np.broadcast_arrays(rows, columns, values)
        self._entries.append(
            (
                at_row.ravel().astype(np.int64),
                at_column.ravel().astype(np.int64),
                value.ravel().astype(np.float64),
            )
        )

    def program(self) -> LinearProgram:
        """Give the program as collected."""
        rows, columns, values = (np.concatenate(part) for part in zip(*self._entries, strict=True))
        matrix = sparse.csc_array(
            sparse.coo_array((values, (rows, columns)), shape=(self._rows, self._columns))
        )
        return LinearProgram(
            costs=np.concatenate(self._costs),
            lower=np.concatenate(self._lower),
            upper=np.full(self._columns, np.inf),
            matrix=matrix,
            row_lower=np.concatenate(self._row_lower),
            row_upper=np.concatenate(self._row_upper),
        )
