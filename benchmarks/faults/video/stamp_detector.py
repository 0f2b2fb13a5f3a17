"""A perfect detector for stamped pictures, as an ONNX network.

For `detect.kind: onnx`: it reads the frame number from the strip in the picture and looks up the boxes of
that frame. A network camera needs it, since the picture at a pulse is not known in advance.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.environment import CannotRunError
from benchmarks.faults.video.stamped_views import (
    BITS,
    BLOCK,
    EDGE,
    FRAMES,
    HEIGHT,
    NUMBER_BITS,
    WIDTH,
    StampedViews,
)

_ROW = 6
"""Left, top, right, bottom, score, class: the output of end-to-end networks."""
_SCORE = 4
_HALF = 0.5
_OPSET, _IR = 17, 8


def write_stamp_detector(views: StampedViews, camera: str, path: Path) -> Path:
    """Write the network for a camera's film.

    Raises:
        CannotRunError: onnx or onnxruntime is missing.
    """
    try:
        import onnx  # noqa: PLC0415 — only this needs it
        import onnxruntime  # noqa: F401, PLC0415 — the site's processes need it
    except ImportError as error:
        raise CannotRunError(f"{error}: pip install 'myview[dev]'") from error
    helper, real = onnx.helper, onnx.TensorProto.FLOAT
    table = _table(views, camera)
    # The strip, the mean of each column, the middle of each block, and whether it is bright.
    steps: list[tuple[str, list[str], str, dict[str, Any]]] = [
        ("Slice", ["picture", "strip_from", "strip_to", "strip_axes"], "strip", {}),
        ("ReduceMean", ["strip"], "columns", {"axes": [0, 1, 2], "keepdims": 0}),
        ("Reshape", ["columns", "blocks_shape"], "blocks", {}),
        ("Slice", ["blocks", "middle_from", "middle_to", "middle_axes"], "middles", {}),
        ("ReduceMean", ["middles"], "grays", {"axes": [1], "keepdims": 0}),
        ("Greater", ["grays", "half"], "bright", {}),
        ("Cast", ["bright"], "bits", {"to": real}),
        # A strip is legible where each bit differs from its inverse in the second half.
        ("Split", ["bits"], "straight inverse", {"axis": 0}),
        ("Sub", ["straight", "inverse"], "difference", {}),
        ("Abs", ["difference"], "differs", {}),
        ("ReduceMin", ["differs"], "legible", {"keepdims": 0}),
        ("Mul", ["straight", "places"], "parts", {}),
        ("ReduceSum", ["parts"], "number", {"keepdims": 0}),
        ("Min", ["number", "last"], "known", {}),
        ("Cast", ["known"], "frame", {"to": onnx.TensorProto.INT64}),
        ("Gather", ["table", "frame"], "rows", {"axis": 0}),
        ("Mul", ["rows", "legible"], "seen", {}),
        ("Unsqueeze", ["seen", "first"], "output", {}),
    ]
    graph = helper.make_graph(
        [
            helper.make_node(kind, given, made.split(), **attributes)
            for kind, given, made, attributes in steps
        ],
        "reader",
        [helper.make_tensor_value_info("picture", real, (1, 3, HEIGHT, WIDTH))],
        [helper.make_tensor_value_info("output", real, (1, *table.shape[1:]))],
        [onnx.numpy_helper.from_array(value, name) for name, value in _numbers(table).items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=_IR)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path


def _numbers(table: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
    places = np.array([1 << place if place < NUMBER_BITS else 0 for place in range(BITS)], dtype=np.float32)
    return {
        "table": table,
        "strip_from": np.array([HEIGHT - BLOCK + EDGE, 0]),
        "strip_to": np.array([HEIGHT - EDGE, 2 * BITS * BLOCK]),
        "strip_axes": np.array([2, 3]),
        "blocks_shape": np.array([2 * BITS, BLOCK]),
        "middle_from": np.array([EDGE]),
        "middle_to": np.array([BLOCK - EDGE]),
        "middle_axes": np.array([1]),
        "half": np.array(_HALF, dtype=np.float32),
        "places": places,
        "last": np.array(FRAMES - 1, dtype=np.float32),
        "first": np.array([0]),
    }


def _table(views: StampedViews, camera: str) -> NDArray[np.float32]:
    """Return the people in each frame of a film, `(frames, most people, 6)`; zeros: no person."""
    frames: list[list[tuple[float, ...]]] = [[] for _ in range(FRAMES)]
    for (of, *sides), frame in views.found.items():
        if of == camera:
            frames[frame].append((*(side / 1000 for side in sides), 1.0, 0.0))
    table = np.zeros((FRAMES, max(map(len, frames)), _ROW), dtype=np.float32)
    for frame, rows in enumerate(frames):
        table[frame, : len(rows)] = rows
    return table
