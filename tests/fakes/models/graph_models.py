"""TensorFlow.js graph models: written as files, and computed node by node with NumPy."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]


class GraphModelFile:
    """A graph model under construction, and its two files."""

    def __init__(self, name: str, shape: Sequence[int]) -> None:
        self.nodes: list[dict[str, Any]] = [{"name": name, "op": "Placeholder", "attr": {}}]
        self.weights: dict[str, npt.NDArray[Any]] = {}
        self.input, self.shape = name, tuple(shape)

    def constant(self, name: str, value: npt.ArrayLike, dtype: str = "float32") -> str:
        """Add a constant; floats are stored in half precision, as in published models."""
        self.weights[name] = np.asarray(value, dtype=dtype)
        self.nodes.append({"name": name, "op": "Const", "attr": {}})
        return name

    def add(self, operation: str, inputs: Sequence[str], name: str, **attributes: Any) -> str:
        """Add a node; return its name."""
        encoded = {key: _attribute(value) for key, value in attributes.items()}
        self.nodes.append({"name": name, "op": operation, "input": list(inputs), "attr": encoded})
        return name

    def topology(self) -> bytes:
        """Return the JSON file."""
        manifest = []
        for name, value in self.weights.items():
            entry: dict[str, Any] = {"name": name, "shape": value.shape, "dtype": str(value.dtype)}
            if value.dtype == np.float32:
                entry["quantization"] = {"dtype": "float16", "original_dtype": "float32"}
            manifest.append(entry)
        document = {"modelTopology": {"node": self.nodes}, "weightsManifest": [{"weights": manifest}]}
        return json.dumps(document).encode()

    def binary(self) -> bytes:
        """Return the file of the weights."""
        stored = (
            value.astype(np.float16) if value.dtype == np.float32 else value
            for value in self.weights.values()
        )
        return b"".join(value.tobytes() for value in stored)

    def compute(self, image: Floats, output: str) -> Floats:
        """Compute an output with NumPy."""
        values: dict[str, Any] = {self.input: image}
        for node in self.nodes:
            name = node["name"]
            if node["op"] == "Const":
                value = self.weights[name]
                is_float = value.dtype == np.float32
                values[name] = value.astype(np.float16).astype(np.float32) if is_float else value
            elif node["op"] != "Placeholder":
                values[name] = _compute(node, [values[part] for part in node["input"]])
        return np.asarray(values[output], dtype=np.float32)


def _attribute(value: object) -> dict[str, Any]:
    match value:
        case bool():
            return {"b": value}
        case float():
            return {"f": value}
        case str():
            return {"s": base64.b64encode(value.encode()).decode()}
        case [str(), *_]:
            return {"list": {"s": [base64.b64encode(str(text).encode()).decode() for text in value]}}
        case [*_]:
            return {"list": {"i": [str(number) for number in value]}}
    raise TypeError(value)


def _compute(node: Mapping[str, Any], inputs: Sequence[Any]) -> Any:
    attributes, operation = node["attr"], node["op"]
    if "Conv" in operation and operation != "ConcatV2":
        return _convolve(node, inputs, depthwise="Depthwise" in operation)
    if operation == "LeakyRelu":
        return np.where(inputs[0] > 0, inputs[0], inputs[0] * np.float32(attributes["alpha"]["f"]))
    if operation == "Mean":
        return inputs[0].mean(axis=tuple(inputs[1]), keepdims=attributes["keep_dims"]["b"])
    return _OPERATIONS[operation](*inputs)


def _resize(images: Floats, size: npt.NDArray[np.int32]) -> Floats:
    shape = int(size[1]), int(size[0])
    return np.asarray(cv2.resize(images[0], shape, interpolation=cv2.INTER_LINEAR)[None], dtype=np.float32)


_OPERATIONS: dict[str, Callable[..., Any]] = {
    "Pad": np.pad,
    "Relu": lambda value: np.maximum(value, 0.0),
    "Relu6": lambda value: np.clip(value, 0.0, 6.0),
    "Sigmoid": lambda value: 1.0 / (1.0 + np.exp(-value)),
    "Mul": np.multiply,
    "ConcatV2": lambda *parts: np.concatenate(parts[:-1], axis=int(parts[-1])),
    "Transpose": np.transpose,
    "ResizeBilinear": _resize,
}


def _convolve(node: Mapping[str, Any], inputs: Sequence[Any], *, depthwise: bool) -> Any:
    image, weights = inputs[0][0], inputs[1]
    stride = int(node["attr"]["strides"]["list"]["i"][1])
    rows, columns = weights.shape[:2]
    height, width = image.shape[:2]
    if base64.b64decode(node["attr"]["padding"]["s"]) == b"SAME":
        out = -(-height // stride), -(-width // stride)
        missing = (
            max((out[0] - 1) * stride + rows - height, 0),
            max((out[1] - 1) * stride + columns - width, 0),
        )
        image = np.pad(image, [*((side // 2, side - side // 2) for side in missing), (0, 0)])
    else:
        out = (height - rows) // stride + 1, (width - columns) // stride + 1
    result = []
    for y in range(out[0]):
        for x in range(out[1]):
            patch = image[y * stride : y * stride + rows, x * stride : x * stride + columns]
            subscripts = "yxc,yxcm->cm" if depthwise else "yxc,yxco->o"
            result.append(np.einsum(subscripts, patch, weights).ravel())
    value = np.array(result, dtype=np.float32).reshape(1, *out, -1)
    fused = [
        base64.b64decode(text).decode()
        for text in node["attr"].get("fused_ops", {"list": {"s": []}})["list"]["s"]
    ]
    if "BiasAdd" in fused:
        value = value + inputs[2]
    return np.maximum(value, 0.0) if "Relu" in fused else value


def centernet_model() -> GraphModelFile:
    """Return a random graph model with CenterNet's outputs at a stride of 4."""
    numbers = np.random.default_rng(5)
    model = GraphModelFile("tower_0/images", (1, 512, 512, 3))
    for name, channels in (("heat", 80), ("distances", 4)):
        weights = model.constant(f"{name}_weights", numbers.normal(0.0, 0.003, (4, 4, 3, channels)))
        model.add("Conv2D", ["tower_0/images", weights], name, strides=[1, 4, 4, 1], padding="VALID")
    model.add("Sigmoid", ["heat"], "tower_0/keypoints")
    model.add("Relu", ["distances"], "tower_0/wh")
    return model


def nanodet_model() -> GraphModelFile:
    """Return a random graph model with NanoDet's outputs at strides of 8, 16 and 32."""
    numbers = np.random.default_rng(6)
    model = GraphModelFile("input_1", (1, 3, 416, 416))
    last = model.constant("channels_last", [0, 2, 3, 1], "int32")
    first = model.constant("channels_first", [0, 3, 1, 2], "int32")
    model.add("Transpose", ["input_1", last], "pixels")
    for stride, name in ((8, "transpose_99"), (16, "transpose_105"), (32, "transpose_111")):
        weights = model.constant(f"weights_{stride}", numbers.normal(0.0, 0.1, (8, 8, 3, 124)))
        steps = [1, stride, stride, 1]
        model.add("Conv2D", ["pixels", weights], f"maps_{stride}", strides=steps, padding="VALID")
        model.add("Transpose", [f"maps_{stride}", first], f"PartitionedCall/{name}")
    return model
