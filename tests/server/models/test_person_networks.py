"""The networks' boxes and scores are those that NumPy decodes from the models' outputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fakes.models.graph_models import Floats, centernet_model, nanodet_model
from server.models.graph_model import read_graph_model
from server.models.person_networks import (
    CENTERNET_CALIBRATION,
    NANODET_CALIBRATION,
    SSD_CALIBRATION,
    cell_centers,
    centernet_network,
    nanodet_network,
    ssd_anchors,
    ssd_network,
)

onnxruntime = pytest.importorskip("onnxruntime", reason="needs onnxruntime: pip install 'myview[neural]'")
onnx = pytest.importorskip("onnx", reason="needs onnx: pip install 'myview[neural]'")

SIZE = (32, 64)
IMAGE = np.random.default_rng(2).random((1, 3, *SIZE), dtype=np.float32)


def calibrated(logits: Any, calibration: tuple[float, float]) -> Any:
    return 1.0 / (1.0 + np.exp(-(calibration[0] * logits + calibration[1])))


def run(network: bytes, image: Floats) -> Any:
    session = onnxruntime.InferenceSession(network, providers=["CPUExecutionProvider"])
    return session.run(None, {"images": image})[0]


def test_centernet_returns_local_maxima_with_their_boxes() -> None:
    model = centernet_model()
    levels = IMAGE.transpose(0, 2, 3, 1) * 255.0
    heat, distances = (
        model.compute(levels, "tower_0/keypoints")[0, ..., 0],
        model.compute(levels, "tower_0/wh")[0],
    )
    people = run(centernet_network(read_graph_model(model.topology(), model.binary()), SIZE), IMAGE)[0].T
    padded = np.pad(heat, 1, constant_values=-np.inf)
    rows, columns = heat.shape
    assert people.shape == (rows * columns, 5)
    for y in range(rows):
        for x in range(columns):
            center_x, center_y, width, height, score = people[y * columns + x]
            is_peak = heat[y, x] == padded[y : y + 3, x : x + 3].max()
            logit = np.log(heat[y, x] / (1.0 - heat[y, x]))
            probability = calibrated(logit, CENTERNET_CALIBRATION) if is_peak else 0.0
            assert score == pytest.approx(probability, abs=1e-3)
            left, top, right, bottom = distances[y, x]
            sides = [4 * x - left, 4 * y - top, 4 * x + right, 4 * y + bottom]
            found = [center_x - width / 2, center_y - height / 2, center_x + width / 2, center_y + height / 2]
            assert found == pytest.approx(sides, abs=1e-2)


def test_nanodet_returns_expected_distances_around_cell_centers() -> None:
    model = nanodet_model()
    people = run(nanodet_network(read_graph_model(model.topology(), model.binary()), SIZE), IMAGE)[0].T
    expected = []
    for stride, name in ((8, "transpose_99"), (16, "transpose_105"), (32, "transpose_111")):
        maps = model.compute(IMAGE, f"PartitionedCall/{name}")[0].reshape(124, -1).T
        shares = np.exp(maps[:, 80:].reshape(-1, 4, 11))
        distances = (shares / shares.sum(axis=2, keepdims=True)) @ np.arange(11) * stride
        centers = cell_centers((SIZE[0] // stride, SIZE[1] // stride), stride)[0]
        before, after = centers - distances[:, :2], centers + distances[:, 2:]
        scores = calibrated(maps[:, :1], NANODET_CALIBRATION)
        expected.append(np.hstack([(before + after) / 2.0, after - before, scores]))
    np.testing.assert_allclose(people, np.concatenate(expected), atol=1e-2)


def test_ssd_anchors_cover_the_image_on_six_grids() -> None:
    anchors = ssd_anchors()
    assert anchors.shape == (1917, 4)
    assert np.all((anchors[:, :2] > 0.0) & (anchors[:, :2] < 1.0))
    np.testing.assert_allclose(anchors[0], [0.5 / 19, 0.5 / 19, 0.1, 0.1], rtol=1e-6)
    np.testing.assert_allclose(anchors[-1], [0.5, 0.5, np.sqrt(0.95), np.sqrt(0.95)], rtol=1e-6)


def test_ssd_offsets_move_and_scale_the_anchors() -> None:
    offsets = np.random.default_rng(3).normal(0.0, 1.0, (1, 1917, 4)).astype(np.float32)
    scores = np.random.default_rng(4).normal(0.0, 1.0, (1, 1917, 24)).astype(np.float32)
    people = run(ssd_network(raw_ssd(offsets, scores)), np.full((1, 3, 300, 300), 1.0, dtype=np.float32))[0].T
    anchors = ssd_anchors()
    centers = offsets[0, :, :2] / 10.0 * anchors[:, 2:] + anchors[:, :2]
    sizes = np.exp(offsets[0, :, 2:] / 5.0) * anchors[:, 2:]
    np.testing.assert_allclose(people[:, :2], 300.0 * centers[:, ::-1], rtol=1e-3, atol=1e-2)
    np.testing.assert_allclose(people[:, 2:4], 300.0 * sizes[:, ::-1], rtol=1e-3, atol=1e-2)
    np.testing.assert_allclose(
        people[:, 4], calibrated(scores[0, :, 4], SSD_CALIBRATION), rtol=1e-3, atol=1e-6
    )


def raw_ssd(offsets: Floats, scores: Floats) -> Any:
    """Return a network with these outputs for a white image, whose input has the value 1."""
    helper, types = onnx.helper, onnx.TensorProto
    first = {"begin": [0, 0, 0, 0], "end": [1, 1, 1, 1]}
    nodes = [
        helper.make_node("Slice", ["pixels", "begin", "end"], ["pixel"]),
        helper.make_node("Squeeze", ["pixel"], ["light"]),
        helper.make_node("Mul", ["all_offsets", "light"], ["offsets"]),
        helper.make_node("Mul", ["all_scores", "light"], ["scores"]),
    ]
    constants = {"all_offsets": offsets, "all_scores": scores} | {
        name: np.array(value, dtype=np.int64) for name, value in first.items()
    }
    graph = helper.make_graph(
        nodes,
        "raw",
        [helper.make_tensor_value_info("pixels", types.FLOAT, [1, 3, 300, 300])],
        [
            helper.make_tensor_value_info("offsets", types.FLOAT, offsets.shape),
            helper.make_tensor_value_info("scores", types.FLOAT, scores.shape),
        ],
        [onnx.numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 11)], ir_version=8)


def test_a_network_with_other_outputs_is_refused() -> None:
    with pytest.raises(ValueError, match="not boxes and class scores"):
        ssd_network(raw_ssd(np.zeros((1, 1917, 3), np.float32), np.zeros((1, 1917, 24), np.float32)))
