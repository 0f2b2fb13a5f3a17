"""Networks of single images, changed so that they take any number of images at once."""

from __future__ import annotations

from typing import Any

BATCH = "batch"


def batched_network(content: bytes) -> bytes:
    """Return a network whose input and outputs have as many images as are given.

    The networks of the catalog keep the images apart in the first dimension of whatever they compute, which
    only the constants of `Reshape` fix to 1.

    Raises:
        ImportError: the package onnx is not installed.
    """
    import onnx  # noqa: PLC0415 — an optional dependency

    model = onnx.load_model_from_string(content)
    shapes = {node.input[1] for node in model.graph.node if node.op_type == "Reshape"}
    for constant in model.graph.initializer:
        if constant.name in shapes:
            sides = onnx.numpy_helper.to_array(constant).copy()
            if sides[0] == 1:
                sides[0] = 0  # as in the input
                constant.CopyFrom(onnx.numpy_helper.from_array(sides, constant.name))
    for value in (*model.graph.input, *model.graph.output):
        _open_first(value.type.tensor_type.shape)
    del model.graph.value_info[:]
    return bytes(model.SerializeToString())


def _open_first(shape: Any) -> None:
    shape.dim[0].dim_param = BATCH
