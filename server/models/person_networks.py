"""Networks of people with one interface, whatever they were made of.

Input: (1, 3, H, W), RGB, 0 to 1. Output: (1, 5, N) as YOLOv8's: center x, center y, width and height in
pixels of the input, and the score of the only class, person. `tracking.detectors.OnnxDetector` runs them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from server.models.graph_model import GraphModel
from server.models.onnx_builder import OnnxBuilder
from server.models.tfjs_conversion import OPSET, GraphConverter

Floats = npt.NDArray[np.float32]

_INPUT, _OUTPUT = "images", "people"
_COCO_PERSON = 0
_NANODET_CLASSES, _NANODET_BINS, _NANODET_SIDE = 80, 11, 416
_NANODET_OUTPUTS = {  # by stride: scores before the sigmoid, and distances
    8: "PartitionedCall/transpose_99",
    16: "PartitionedCall/transpose_105",
    32: "PartitionedCall/transpose_111",
}
_CENTERNET_STRIDE, _CENTERNET_SIDE = 4, 512
_SSD_SIDE, _SSD_CELLS, _SSD_PERSON = 300, (19, 10, 5, 3, 2, 1), 4

# Slope and offset of a score's logit that make it the probability of a person (Platt, Probabilistic outputs
# for support vector machines, 1999). Fitted by `python -m benchmarks.detectors.score_calibration`. Errors:
# .05 to .14 on terrace and pets09; .03 (NanoDet), .06 (CenterNet) and .23 (SSD) on terrace2.
SSD_CALIBRATION, NANODET_CALIBRATION, CENTERNET_CALIBRATION = (4.2, 1.5), (2.9, 1.2), (3.6, 1.3)


def nanodet_network(model: GraphModel, size: tuple[int, int]) -> bytes:
    """Return NanoDet as an ONNX file: class scores, and for each side a distribution over distances.

    Args:
        model: the graph model, exported for images (1, 3, 416, 416).
        size: height and width of the input, multiples of 32.

    Raises:
        ValueError: the model cannot be converted.
    """
    converter = GraphConverter(model, (size[0] / _NANODET_SIDE, size[1] / _NANODET_SIDE))
    onnx = converter.onnx
    onnx.add("Identity", [_INPUT], "input_1")
    parts = []
    for stride, name in _NANODET_OUTPUTS.items():
        maps = onnx.reshape(converter.convert(name), [1, _NANODET_CLASSES + 4 * _NANODET_BINS, -1])
        rows = onnx.add("Transpose", [maps], perm=[0, 2, 1])
        logits = onnx.columns(rows, _COCO_PERSON, _COCO_PERSON + 1)
        scores = _calibrate(onnx, logits, NANODET_CALIBRATION)
        bins = onnx.columns(rows, _NANODET_CLASSES, _NANODET_CLASSES + 4 * _NANODET_BINS)
        shares = onnx.add("Softmax", [onnx.reshape(bins, [1, -1, 4, _NANODET_BINS])], axis=-1)
        steps = onnx.constant(np.arange(_NANODET_BINS, dtype=np.float32)[:, None] * np.float32(stride))
        distances = onnx.reshape(onnx.add("MatMul", [shares, steps]), [1, -1, 4])
        centers = cell_centers((size[0] // stride, size[1] // stride), stride)
        parts.append(_boxes_by_distances(onnx, centers, distances, scores))
    return _write(onnx, parts, size, OPSET)


def centernet_network(model: GraphModel, size: tuple[int, int]) -> bytes:
    """Return CenterNet as an ONNX file: people are local maxima of a heat map, with distances to their sides.

    Args:
        model: the graph model, exported for images (1, 512, 512, 3), 0 to 255.
        size: height and width of the input, multiples of 32.

    Raises:
        ValueError: the model cannot be converted.
    """
    converter = GraphConverter(model, (size[0] / _CENTERNET_SIDE, size[1] / _CENTERNET_SIDE))
    onnx = converter.onnx
    onnx.scale(onnx.add("Transpose", [_INPUT], perm=[0, 2, 3, 1]), 255.0, "tower_0/images")
    classes = converter.convert("tower_0/keypoints")
    heat = onnx.add(
        "Transpose", [onnx.columns(classes, _COCO_PERSON, _COCO_PERSON + 1, axis=3)], perm=[0, 3, 1, 2]
    )
    highest = onnx.add("MaxPool", [heat], kernel_shape=[3, 3], strides=[1, 1], auto_pad="SAME_UPPER")
    is_peak = onnx.add("Cast", [onnx.add("Equal", [heat, highest])], to=1)
    probability = _calibrate(onnx, _logit(onnx, heat), CENTERNET_CALIBRATION)
    scores = onnx.reshape(onnx.add("Mul", [probability, is_peak]), [1, -1, 1])
    distances = onnx.reshape(converter.convert("tower_0/wh"), [1, -1, 4])
    cells = (size[0] // _CENTERNET_STRIDE, size[1] // _CENTERNET_STRIDE)
    corners = cell_centers(cells, _CENTERNET_STRIDE) - np.float32(_CENTERNET_STRIDE / 2)
    return _write(onnx, [_boxes_by_distances(onnx, corners, distances, scores)], size, OPSET)


def ssd_network(model: Any) -> bytes:
    """Return SSD-MobileNetV2 as an ONNX file, from the `onnx.ModelProto` of its raw outputs.

    Its input is (1, 3, 300, 300), -1 to 1; its outputs are offsets to anchors and class scores before the
    sigmoid (Liu et al., SSD: Single Shot MultiBox Detector, ECCV 2016).

    Raises:
        ValueError: the model has other inputs or outputs.
    """
    graph = model.graph
    by_columns = {output.type.tensor_type.shape.dim[-1].dim_value: output.name for output in graph.output}
    if len(graph.input) != 1 or len(by_columns) != 2 or 4 not in by_columns:  # noqa: PLR2004 — boxes and classes
        raise ValueError("the network's outputs are not boxes and class scores")
    offsets, classes = by_columns.pop(4), by_columns.popitem()[1]
    onnx = OnnxBuilder()
    one = onnx.constant(np.array(1.0, dtype=np.float32))
    onnx.add("Sub", [onnx.scale(_INPUT, 2.0), one], graph.input[0].name)
    onnx.nodes += graph.node
    onnx.initializers += graph.initializer
    anchors = ssd_anchors()
    # Offsets are (y, x, height, width), the positions times 10 and the logarithms of sizes times 5.
    positions = onnx.scale(onnx.columns(offsets, 0, 2), anchors[None, :, 2:] / np.float32(10.0))
    centers = onnx.add("Add", [positions, onnx.constant(anchors[None, :, :2])])
    sizes = onnx.scale(onnx.add("Exp", [onnx.scale(onnx.columns(offsets, 2, 4), 0.2)]), anchors[None, :, 2:])
    scores = _calibrate(onnx, onnx.columns(classes, _SSD_PERSON, _SSD_PERSON + 1), SSD_CALIBRATION)
    order = onnx.constant(np.array([1, 0, 3, 2], dtype=np.int64))
    boxes = onnx.add("Gather", [onnx.add("Concat", [centers, sizes], axis=2), order], axis=2)
    people = onnx.add("Concat", [onnx.scale(boxes, float(_SSD_SIDE)), scores], axis=2)
    return _write(onnx, [people], (_SSD_SIDE, _SSD_SIDE), model.opset_import[0].version)


def ssd_anchors() -> Floats:
    """Return SSD-MobileNetV2's anchors (1917, 4): center y, center x, height, width, as shares."""
    scales = [0.2 + 0.75 * layer / (len(_SSD_CELLS) - 1) for layer in range(len(_SSD_CELLS))] + [1.0]
    anchors = []
    for layer, side in enumerate(_SSD_CELLS):
        shapes = [(scales[layer], ratio) for ratio in (1.0, 2.0, 0.5, 3.0, 1.0 / 3.0)]
        shapes.append((math.sqrt(scales[layer] * scales[layer + 1]), 1.0))
        if layer == 0:
            shapes = [(0.1, 1.0), (scales[0], 2.0), (scales[0], 0.5)]
        sizes = [(scale / math.sqrt(ratio), scale * math.sqrt(ratio)) for scale, ratio in shapes]
        for cell in range(side * side):
            y, x = divmod(cell, side)
            anchors += [((y + 0.5) / side, (x + 0.5) / side, *size) for size in sizes]
    return np.array(anchors, dtype=np.float32)


def cell_centers(cells: tuple[int, int], stride: int) -> Floats:
    """Return the centers (1, h · w, 2), x and y, of a grid of (h, w) cells in pixels, row by row."""
    y, x = np.mgrid[: cells[0], : cells[1]].reshape(2, -1)
    return (np.stack([x, y], axis=1)[None].astype(np.float32) + np.float32(0.5)) * np.float32(stride)


def _calibrate(onnx: OnnxBuilder, logits: str, calibration: tuple[float, float]) -> str:
    """Return the probabilities that belong to the logits of scores."""
    slope, offset = calibration
    shifted = onnx.add("Add", [onnx.scale(logits, slope), onnx.constant(np.array(offset, dtype=np.float32))])
    return onnx.add("Sigmoid", [shifted])


def _logit(onnx: OnnxBuilder, scores: str) -> str:
    """Return the logits of scores between 0 and 1."""
    low, high = (onnx.constant(np.array(bound, dtype=np.float32)) for bound in (1e-5, 1.0 - 1e-5))
    clipped = onnx.add("Clip", [scores, low, high])
    one = onnx.constant(np.array(1.0, dtype=np.float32))
    return onnx.add("Log", [onnx.add("Div", [clipped, onnx.add("Sub", [one, clipped])])])


def _boxes_by_distances(onnx: OnnxBuilder, points: Floats, distances: str, scores: str) -> str:
    """Return center, size and score (1, N, 5); distances are to left, top, right and bottom."""
    center = onnx.constant(points)
    before = onnx.add("Sub", [center, onnx.columns(distances, 0, 2)])
    after = onnx.add("Add", [center, onnx.columns(distances, 2, 4)])
    middle = onnx.scale(onnx.add("Add", [before, after]), 0.5)
    return onnx.add("Concat", [middle, onnx.add("Sub", [after, before]), scores], axis=2)


def _write(onnx: OnnxBuilder, parts: Sequence[str], size: tuple[int, int], opset: int) -> bytes:
    """Return the ONNX file whose output are all parts (1, N, 5), as columns."""
    rows = onnx.add("Concat", parts, axis=1) if len(parts) > 1 else parts[0]
    onnx.add("Transpose", [rows], _OUTPUT, perm=[0, 2, 1])
    return onnx.write((_INPUT, [1, 3, *size]), (_OUTPUT, [1, 5, None]), opset)
