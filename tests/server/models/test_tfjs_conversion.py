"""Converted graph models compute what NumPy computes, at any input size; others are refused in one line."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.models.graph_models import Floats, GraphModelFile
from server.models.graph_model import read_graph_model
from server.models.tfjs_conversion import OPSET, GraphConverter

onnxruntime = pytest.importorskip("onnxruntime", reason="needs onnxruntime: pip install 'myview[neural]'")
pytest.importorskip("onnx", reason="needs onnx: pip install 'myview[neural]'")

NUMBERS = np.random.default_rng(1)
STRIDE = {"strides": [1, 2, 2, 1]}


def random(*shape: int) -> Floats:
    return NUMBERS.normal(0.0, 1.0, shape).astype(np.float32)


def run(model: GraphModelFile, output: str, image: Floats, scale: tuple[float, float] = (1.0, 1.0)) -> Any:
    converter = GraphConverter(read_graph_model(model.topology(), model.binary()), scale)
    converter.convert(output)
    network = converter.onnx.write((model.input, image.shape), (output, [None] * 4), OPSET)
    session = onnxruntime.InferenceSession(network, providers=["CPUExecutionProvider"])
    return session.run(None, {model.input: image})[0]


def small_network(height: int = 12, width: int = 16) -> GraphModelFile:
    """Return a network with every operation of the detectors, on (1, height, width, 3)."""
    model = GraphModelFile("images", (1, height, width, 3))
    bias = {"fused_ops": ["BiasAdd", "Relu"]}
    model.add(
        "_FusedConv2D",
        ["images", model.constant("w1", random(3, 3, 3, 8)), model.constant("b1", random(8))],
        "first",
        padding="SAME",
        **STRIDE,
        **bias,
    )
    model.add(
        "DepthwiseConv2dNative",
        ["first", model.constant("w2", random(3, 3, 8, 1))],
        "depthwise",
        padding="SAME",
        strides=[1, 1, 1, 1],
    )
    margins = model.constant("margins", [[0, 0], [1, 1], [1, 1], [0, 0]], "int32")
    model.add("Pad", ["depthwise", margins], "padded")
    model.add(
        "Conv2D", ["padded", model.constant("w3", random(3, 3, 8, 4))], "down", padding="VALID", **STRIDE
    )
    model.add("LeakyRelu", ["down"], "leaky", alpha=0.1)
    model.add("Mean", ["leaky", model.constant("axes", [1, 2], "int32")], "mean", keep_dims=True)
    model.add("Sigmoid", ["mean"], "gate")
    model.add("Mul", ["leaky", "gate"], "gated")
    up = model.constant("up", [height // 2, width // 2], "int32")
    model.add("ResizeBilinear", ["gated", up], "resized", half_pixel_centers=True)
    model.add("ConcatV2", ["resized", "first", model.constant("axis", 3, "int32")], "joined")
    model.add("Relu6", ["joined"], "clipped")
    model.add("Transpose", ["clipped", model.constant("order", [0, 3, 1, 2], "int32")], "maps")
    return model


def test_a_network_computes_what_numpy_computes() -> None:
    model = small_network()
    image = random(1, 12, 16, 3)
    np.testing.assert_allclose(run(model, "maps", image), model.compute(image, "maps"), atol=2e-4)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 4), st.integers(1, 4))
def test_a_network_is_converted_for_another_input_size(rows: int, columns: int) -> None:
    size = (4 * rows, 4 * columns)
    image = random(1, *size, 3)
    converted = run(small_network(12, 16), "maps", image, (size[0] / 12, size[1] / 16))
    assert converted.shape == (1, 12, size[0] // 2, size[1] // 2)


def test_maps_are_resized_with_the_channels_first_since_cuda_resizes_the_last_dimensions() -> None:
    converter = GraphConverter(read_graph_model(small_network().topology(), small_network().binary()))
    converter.convert("resized")
    producers = {node.output[0]: node for node in converter.onnx.nodes}
    (resize,) = [node for node in producers.values() if node.op_type == "Resize"]
    assert list(producers[resize.input[0]].attribute[0].ints) == [0, 3, 1, 2]


def test_only_what_the_output_depends_on_is_converted() -> None:
    model = small_network()
    model.add("TopKV2", ["maps"], "strange")
    assert run(model, "maps", random(1, 12, 16, 3)).shape == (1, 12, 6, 8)
    with pytest.raises(ValueError, match="operation TopKV2 of node strange is not supported"):
        run(model, "strange", random(1, 12, 16, 3))
    with pytest.raises(ValueError, match="the model has no node 'gone'"):
        run(model, "gone", random(1, 12, 16, 3))


def test_damaged_files_are_refused() -> None:
    model = small_network()
    for topology in (b"", b"{}", b"[]", b'{"modelTopology": {"node": [{}]}}', b"\xff"):
        with pytest.raises(ValueError, match=r"not a TensorFlow\.js graph model"):
            read_graph_model(topology, b"")
    with pytest.raises(ValueError, match="the weights end before"):
        read_graph_model(model.topology(), model.binary()[:-2])
    with pytest.raises(ValueError, match="2 bytes follow the last weight"):
        read_graph_model(model.topology(), model.binary() + b"12")


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_any_document_is_read_or_refused(data: st.DataObject) -> None:
    leaf = st.none() | st.integers() | st.text(max_size=3)
    tree = st.recursive(
        leaf, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=4)
    )
    content = json.dumps(data.draw(tree)).encode()
    try:
        read_graph_model(content, data.draw(st.binary(max_size=8)))
    except ValueError:
        return


KEYS = st.sampled_from(
    ["modelTopology", "node", "weightsManifest", "weights", "name", "op", "input", "shape", "dtype"]
)
