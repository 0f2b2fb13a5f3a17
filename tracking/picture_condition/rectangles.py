"""A part of a picture as few rectangles."""

from __future__ import annotations

import cv2
import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Mask
from tracking.picture_condition.structure import PART_CELLS, Cells, grid_of

_MOST = 0.5
"""Least share of a cell that belongs to the part."""


def cells_of(mask: Mask, grid: tuple[int, ...] | None = None) -> Cells:
    """Return the cells `(R, C)` of a picture of which a mask `(h, w)`, 255 or 0, has most.

    Args:
        mask: of the whole picture, at any size.
        grid: rows and columns; None: those of its own size.
    """
    rows, columns = grid_of(mask.shape, PART_CELLS) if grid is None else grid
    shares = cv2.resize(mask, (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(shares >= _MOST * np.iinfo(np.uint8).max)


def cell_rectangles(cells: Cells, size: tuple[int, int]) -> Floats:
    """Return rectangles `(K, 4)` beside each other that fill some cells, in a picture of a `size` (w, h)."""
    found: list[tuple[int, int, int, int]] = []
    open_runs: dict[tuple[int, int], int] = {}
    for row in range(len(cells) + 1):
        runs = _runs(cells[row]) if row < len(cells) else []
        ended = [run for run in open_runs if run not in runs]
        found += [(left, open_runs.pop((left, right)), right, row) for left, right in ended]
        for run in runs:
            open_runs.setdefault(run, row)
    scale = np.array([size[0] / cells.shape[1], size[1] / cells.shape[0]] * 2)
    return scale * np.array(found, dtype=np.float64).reshape(-1, BOX_SIDES)


def _runs(row: Cells) -> list[tuple[int, int]]:
    """Return where the cells of a row begin and end."""
    edges = np.flatnonzero(np.diff(np.pad(row.astype(np.int8), 1)))
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]
