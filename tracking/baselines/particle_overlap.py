"""Who is where among the particles of all: the overlap factor (Todor 2009, section 8.3).

A map counts each object's particles, at their middles; one cell of it is `reduced` pixels wide and high. An
object's own count over that of all objects there is the overlap factor of its particles in that cell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats


def overlap_factors(middles: Sequence[Floats], reduced: int) -> list[Floats]:
    """Give each object's particles their factor.

    Args:
        middles: of each object `(P, 2)`, x and y in pixels.
        reduced: pixels that a cell is wide and high, R.

    Returns:
        Of each object `(P,)`, in (0, 1]: 1 where nobody else has particles.
    """
    if not middles:
        return []
    owner = np.repeat(np.arange(len(middles)), [len(it) for it in middles])
    cells = np.floor(np.concatenate(middles) / reduced).astype(np.int64)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    cell = cell.ravel()
    counts = np.zeros((len(middles), int(cell.max(initial=-1)) + 1))
    np.add.at(counts, (owner, cell), 1.0)
    factors = counts[owner, cell] / counts.sum(axis=0)[cell]
    return [factors[owner == number] for number in range(len(middles))]
