"""Decoder of YOLO outputs in three layouts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats

Layout = Literal["auto", "yolov5", "yolov8", "end2end"]

_BOX = 4
END_TO_END = 6
"""Columns of an end-to-end network's output."""
_MAX_END_TO_END = 1000
"""End-to-end networks return 100 to 300 boxes; one-class YOLOv5 outputs have as many columns, but thousands
of rows."""


@dataclass(frozen=True, slots=True, eq=False)
class DecodedBoxes:
    """Boxes `(N, 4)` in pixels of the network's input, scores `(N,)` in [0, 1]."""

    boxes: Floats
    scores: Floats


def decode_output(output: npt.NDArray[np.floating], layout: Layout, classes: Sequence[int]) -> DecodedBoxes:
    """Decode the output of a YOLO network; a box's score is that of its most likely requested class.

    | layout | shape | a row |
    | --- | --- | --- |
    | `yolov5` (v5, v7) | (1, N, 5 + C) | center x, y, width, height, objectness, C classes |
    | `yolov8` (v8, v9, v11, v12) | (1, 4 + C, N) | center x, y, width, height, C classes, as columns |
    | `end2end` (v10, v26, exports with NMS) | (1, N, 6) | left, top, right, bottom, score, class |

    `auto` selects the layout by the shape. Rows with numbers that are not finite are left out.

    Raises:
        ValueError: the output has none of these shapes, too few classes, or no finite row.
    """
    if output.ndim != 3 or output.shape[0] != 1:  # noqa: PLR2004 — batch, rows, columns
        raise ValueError(_unfit(output.shape))
    table = output[0].astype(np.float64)
    kind = _layout_of(table.shape) if layout == "auto" else layout
    if kind == "yolov8":
        table = table.T
    finite = np.isfinite(table).all(axis=1)
    if len(table) and not finite.any():
        raise ValueError("its output has no finite numbers")
    table = table[finite]
    if kind == "end2end":
        if table.shape[1] != END_TO_END:
            raise ValueError(_unfit(output.shape))
        selected = np.isin(table[:, 5].astype(np.int64), list(classes))
        return DecodedBoxes(table[selected, :_BOX], np.clip(table[selected, _BOX], 0.0, 1.0))
    first = _BOX if kind == "yolov8" else _BOX + 1
    if table.shape[1] <= first:
        raise ValueError(_unfit(output.shape))
    if max(classes) >= table.shape[1] - first:
        raise ValueError(f"it has {table.shape[1] - first} classes, and no class {max(classes)}")
    scores = table[:, [first + number for number in classes]].max(axis=1)
    if kind == "yolov5":
        scores = scores * table[:, _BOX]
    center, half = table[:, :2], table[:, 2:_BOX] / 2.0
    return DecodedBoxes(np.concatenate([center - half, center + half], axis=1), np.clip(scores, 0.0, 1.0))


def _layout_of(shape: tuple[int, ...]) -> Layout:
    rows, columns = shape
    if columns == END_TO_END and rows <= _MAX_END_TO_END:
        return "end2end"
    return "yolov8" if rows < columns else "yolov5"


def _unfit(shape: tuple[int, ...]) -> str:
    return f"its output has the shape {shape}, not (1, N, 5 + C), (1, 4 + C, N) or (1, N, 6) as YOLO's"
