"""Converts TensorFlow.js graph models (a JSON and a binary file) to ONNX, at any input size.

Covers the operations of the detectors in `server.models.catalog`. TensorFlow's images are (N, H, W, C) and
ONNX's (N, C, H, W): transpositions enclose operations on images; onnxruntime removes most of them again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from server.models.graph_model import GraphModel, GraphNode
from server.models.onnx_builder import Array, OnnxBuilder

OPSET = 18
_NCHW, _NHWC = [0, 3, 1, 2], [0, 2, 3, 1]
_FUSED = frozenset({"BiasAdd", "Relu", "Relu6"})
"""Operations that may be part of a convolution."""


class GraphConverter:
    """Converts the part of a graph model that some outputs depend on.

    Args:
        model: the graph model.
        scale: height and width of the input as shares of those that the model was exported with; the sizes of
            resized feature maps scale with it.
    """

    def __init__(self, model: GraphModel, scale: tuple[float, float] = (1.0, 1.0)) -> None:
        self._model, self._scale = model, scale
        self.onnx = OnnxBuilder()
        """The ONNX graph; a node's output has the name that it has in the graph model."""
        self._converted: set[str] = set()

    def convert(self, output: str) -> str:
        """Convert what an output depends on; return its name in the ONNX graph.

        Raises:
            ValueError: the model has no such node, or uses an operation that is not supported.
        """
        pending = [output]
        while pending:
            name = _node_name(pending[-1])
            if name in self._converted:
                pending.pop()
                continue
            node = self._model.nodes.get(name)
            if node is None:
                raise ValueError(f"the model has no node {name!r}")
            missing = [part for part in self._tensor_inputs(node) if _node_name(part) not in self._converted]
            if missing:
                pending += missing
                continue
            self._convert_node(node)
            self._converted.add(name)
            pending.pop()
        return output

    def _tensor_inputs(self, node: GraphNode) -> list[str]:
        """Return the inputs that are computed; constants are added where they are used."""
        return [part for part in node.inputs if _node_name(part) not in self._model.weights]

    def _convert_node(self, node: GraphNode) -> None:
        if node.operation == "Placeholder":
            return
        convert = _CONVERSIONS.get(node.operation)
        if convert is None:
            raise ValueError(f"operation {node.operation} of node {node.name} is not supported")
        convert(self, node)

    def weights(self, name: str) -> Array:
        """Return the value of a constant input.

        Raises:
            ValueError: it is not constant.
        """
        try:
            return self._model.weights[_node_name(name)]
        except KeyError:
            raise ValueError(f"{name} must be a constant") from None

    def tensor(self, name: str) -> str:
        """Return the ONNX name of an input; a constant is added to the graph."""
        value = self._model.weights.get(_node_name(name))
        return name if value is None else self.onnx.constant(value)

    def scaled(self, height: int, width: int) -> list[int]:
        """Return the size of a feature map at the input size that is converted for."""
        return [round(height * self._scale[0]), round(width * self._scale[1])]


def _node_name(tensor: str) -> str:
    """Return the node of a tensor; `^a` is a control dependency on `a`."""
    return tensor.removeprefix("^").split(":")[0]


def _convolution(converter: GraphConverter, node: GraphNode) -> None:
    weights = converter.weights(node.inputs[1])  # (height, width, in, out)
    groups = 1
    if "Depthwise" in node.operation:  # (height, width, channels, multiplier)
        height, width, groups, multiplier = weights.shape
        weights = weights.reshape(height, width, 1, groups * multiplier)
    inputs = [
        converter.onnx.add("Transpose", [converter.tensor(node.inputs[0])], perm=_NCHW),
        converter.onnx.constant(weights.transpose(3, 2, 0, 1)),
    ]
    fused = node.texts("fused_ops") if "fused_ops" in node.attributes else []
    unknown = [operation for operation in fused if operation not in _FUSED]
    if unknown:
        raise ValueError(f"{node.name}: {', '.join(unknown)} inside a convolution is not supported")
    if "BiasAdd" in fused:
        inputs.append(converter.onnx.constant(converter.weights(node.inputs[2])))
    result = converter.onnx.add(
        "Conv",
        inputs,
        strides=node.integers("strides")[1:3],
        dilations=node.integers("dilations")[1:3] if "dilations" in node.attributes else [1, 1],
        group=groups,
        **_padding(node),
    )
    for operation in fused:
        if operation != "BiasAdd":
            result = _activate(converter, operation, result)
    converter.onnx.add("Transpose", [result], node.name, perm=_NHWC)


def _padding(node: GraphNode) -> dict[str, Any]:
    return {"auto_pad": "SAME_UPPER"} if node.text("padding") == "SAME" else {"pads": [0, 0, 0, 0]}


def _activate(converter: GraphConverter, operation: str, value: str, output: str | None = None) -> str:
    if operation == "Relu6":
        bounds = [converter.onnx.constant(np.array(bound, dtype=np.float32)) for bound in (0.0, 6.0)]
        return converter.onnx.add("Clip", [value, *bounds], output)
    return converter.onnx.add(operation, [value], output)


def _activation(converter: GraphConverter, node: GraphNode) -> None:
    _activate(converter, node.operation, converter.tensor(node.inputs[0]), node.name)


def _leaky_relu(converter: GraphConverter, node: GraphNode) -> None:
    alpha = float(node.attributes["alpha"]["f"])
    converter.onnx.add("LeakyRelu", [converter.tensor(node.inputs[0])], node.name, alpha=alpha)


def _elementwise(operation: str) -> Callable[[GraphConverter, GraphNode], None]:
    def convert(converter: GraphConverter, node: GraphNode) -> None:
        converter.onnx.add(operation, [converter.tensor(part) for part in node.inputs], node.name)

    return convert


def _pad(converter: GraphConverter, node: GraphNode) -> None:
    before, after = converter.weights(node.inputs[1]).astype(np.int64).T
    value = converter.weights(node.inputs[2]) if len(node.inputs) > 2 else np.zeros((), dtype=np.float32)  # noqa: PLR2004
    inputs = [
        converter.tensor(node.inputs[0]),
        converter.onnx.constant(np.concatenate([before, after])),
        converter.onnx.constant(value.astype(np.float32)),
    ]
    converter.onnx.add("Pad", inputs, node.name)


def _transpose(converter: GraphConverter, node: GraphNode) -> None:
    order = converter.weights(node.inputs[1]).tolist()
    converter.onnx.add("Transpose", [converter.tensor(node.inputs[0])], node.name, perm=order)


def _concatenate(converter: GraphConverter, node: GraphNode) -> None:
    *parts, axis = node.inputs
    converter.onnx.add(
        "Concat",
        [converter.tensor(part) for part in parts],
        node.name,
        axis=int(converter.weights(axis)),
    )


def _mean(converter: GraphConverter, node: GraphNode) -> None:
    axes = converter.onnx.constant(np.atleast_1d(converter.weights(node.inputs[1])).astype(np.int64))
    keep = int(node.is_set("keep_dims"))
    converter.onnx.add("ReduceMean", [converter.tensor(node.inputs[0]), axes], node.name, keepdims=keep)


def _max_pool(converter: GraphConverter, node: GraphNode) -> None:
    images = converter.onnx.add("Transpose", [converter.tensor(node.inputs[0])], perm=_NCHW)
    pooled = converter.onnx.add(
        "MaxPool",
        [images],
        kernel_shape=node.integers("ksize")[1:3],
        strides=node.integers("strides")[1:3],
        **_padding(node),
    )
    converter.onnx.add("Transpose", [pooled], node.name, perm=_NHWC)


def _resize(converter: GraphConverter, node: GraphNode) -> None:
    height, width = (int(side) for side in converter.weights(node.inputs[1]))
    # Channels first: onnxruntime resizes the last two dimensions on CUDA, whatever the sizes say.
    images = converter.onnx.add("Transpose", [converter.tensor(node.inputs[0])], perm=_NCHW)
    sides = converter.onnx.constant(np.array(converter.scaled(height, width), dtype=np.int64))
    # onnxruntime's optimizer loses the sizes of a `Resize` that names its axes.
    kept = converter.onnx.add("Shape", [images], start=0, end=2)
    sizes = converter.onnx.add("Concat", [kept, sides], axis=0)
    mode = "half_pixel" if node.is_set("half_pixel_centers") else "asymmetric"
    if node.is_set("align_corners"):
        mode = "align_corners"
    resized = converter.onnx.add(
        "Resize",
        [images, "", "", sizes],
        mode="linear",
        coordinate_transformation_mode=mode,
    )
    converter.onnx.add("Transpose", [resized], node.name, perm=_NHWC)


_CONVERSIONS: dict[str, Callable[[GraphConverter, GraphNode], None]] = {
    "Add": _elementwise("Add"),
    "AddV2": _elementwise("Add"),
    "ConcatV2": _concatenate,
    "Conv2D": _convolution,
    "DepthwiseConv2dNative": _convolution,
    "FusedDepthwiseConv2dNative": _convolution,
    "Identity": _elementwise("Identity"),
    "LeakyRelu": _leaky_relu,
    "MaxPool": _max_pool,
    "Mean": _mean,
    "Mul": _elementwise("Mul"),
    "Pad": _pad,
    "PadV2": _pad,
    "Relu": _activation,
    "Relu6": _activation,
    "ResizeBilinear": _resize,
    "Sigmoid": _elementwise("Sigmoid"),
    "Sub": _elementwise("Sub"),
    "Transpose": _transpose,
    "_FusedConv2D": _convolution,
}
