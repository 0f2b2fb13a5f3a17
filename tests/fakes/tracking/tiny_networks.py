"""Tiny ONNX networks with given outputs, in the layouts of the YOLO family."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

onnx = pytest.importorskip("onnx", reason="needs onnx to build a network with: pip install 'myview[dev]'")
pytest.importorskip("onnxruntime", reason="needs onnxruntime: pip install 'myview[neural]'")

Table = npt.NDArray[np.float32]


def save_network(
    path: Path, table: Table, size: tuple[int | str, int | str] = (64, 96), kind: str = "FLOAT"
) -> Path:
    """Write a network that returns the table, with scores multiplied by the brightness of the first pixel.

    The input is `(1, 3, h, w)`; the first pixel is at the letterbox's corner, so a network that gets the gray
    bars there returns scores of 114/255 of the table.
    """
    helper, types = onnx.helper, onnx.TensorProto
    element = getattr(types, kind)
    shape = (1, 3, *size)
    nodes = [
        helper.make_node("Slice", ["picture", "begin", "end", "axes"], ["corner"]),
        helper.make_node("ReduceMean", ["corner"], ["light"], keepdims=0),
        helper.make_node("Mul", ["table", "light"], ["scaled"]),
        helper.make_node("Where", ["scores", "scaled", "table"], ["output"]),
    ]
    real = np.float16 if kind == "FLOAT16" else np.float32
    given = {
        "table": table.astype(real),
        "scores": _scores(table),
        "begin": np.zeros(2, dtype=np.int64),
        "end": np.ones(2, dtype=np.int64),
        "axes": np.array([2, 3], dtype=np.int64),
    }
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("picture", element, shape)],
        [helper.make_tensor_value_info("output", element, table.shape)],
        [onnx.numpy_helper.from_array(value, name) for name, value in given.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path


def _scores(table: Table) -> npt.NDArray[np.bool_]:
    """Mark the numbers of the table that are scores: those up to 1."""
    return np.asarray(table <= 1.0)


def yolov5(rows: Sequence[Sequence[float]], boxes: int = 20) -> Table:
    """Return `(1, boxes, 5 + C)`: the rows, padded with zeros."""
    table = np.zeros((1, boxes, len(rows[0])), dtype=np.float32)
    table[0, : len(rows)] = rows
    return table


def yolov8(rows: Sequence[Sequence[float]], boxes: int = 20) -> Table:
    """Return `(1, 4 + C, boxes)`."""
    return np.ascontiguousarray(yolov5(rows, boxes).transpose(0, 2, 1))
