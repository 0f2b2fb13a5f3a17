"""The configuration selects the detector; errors in it are reported in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fakes.tracking.tiny_networks import save_network, yolov8
from server.camera.detector_setup import make_detector
from server.config.loader import build_config
from server.media.letterbox import Letterbox
from server.system.errors import UserError
from tracking.detectors import PAPER_DETECTOR, BackgroundDetector, FusedDetector, HogDetector, MotFileDetector

SIZE = (64, 48)


def observer(folder: Path, detect: dict[str, Any], **camera: Any) -> Any:
    site = {"width": SIZE[0], "height": SIZE[1]}
    cameras = [{"id": "c0", "source": "none.mp4", **camera}]
    config = build_config(
        {"site": site, "cameras": cameras, "detect": detect}, where="site.yaml", folder=folder
    )
    return make_detector(config, config.cameras[0], Letterbox(SIZE, SIZE))


def test_the_kind_selects_the_detector(tmp_path: Path) -> None:
    assert isinstance(observer(tmp_path, {}), BackgroundDetector)
    hog = observer(
        tmp_path,
        {"kind": "hog", "hog": {"max_detections": 3}, "appearance": {"color": False}, "gray_bins": 16},
    )
    assert isinstance(hog, HogDetector)
    assert (hog.settings.max_detections, hog.appearance_bins) == (3, 16)


def test_kind_fused_takes_the_network_and_the_background(tmp_path: Path) -> None:
    save_network(tmp_path / "tiny.onnx", yolov8([(30.0, 32.0, 12.0, 40.0, 0.72)]))
    fused = observer(tmp_path, {"kind": "fused", "onnx": {"model": "tiny.onnx", "resize": "stretch"}})
    assert isinstance(fused, FusedDetector)
    found = fused.detect(np.full((SIZE[1], SIZE[0], 3), 255, dtype=np.uint8))
    assert found.scores == pytest.approx([0.72])
    assert found.histograms.shape == (1, fused.appearance_bins)


def test_kind_boxes_always_has_the_settings_of_the_paper(tmp_path: Path) -> None:
    boxes = observer(tmp_path, {"kind": "boxes", "height_model": {"enabled": True}})
    assert isinstance(boxes, BackgroundDetector)
    for part in ("appearance", "shadows", "box_filter", "height_model", "foreground_fit"):
        assert getattr(boxes.settings, part) == getattr(PAPER_DETECTOR, part)


@pytest.mark.parametrize(
    ("row", "unit", "slope"),
    [(-10.0, "m", 0.5), (8.0, "cm", 0.5), (8.0, "grid", None), (8.0, "mm", None), (30.0, "m", None)],
)
def test_a_metric_homography_gives_the_height_of_people(
    tmp_path: Path, row: float, unit: str, slope: float | None
) -> None:
    high = 3.4 * {"cm": 100.0}.get(unit, 1.0)
    ground = [[high, 0.0, -high * SIZE[0] / 2.0], [0.0, 0.0, 60.0 * high], [0.0, 1.0, -row]]
    detector = observer(tmp_path, {}, ground=ground, ground_unit=unit)
    detector.detect(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))
    line = detector.height_model
    assert (line is not None) == (slope is not None)
    if line is not None:
        assert line.expected_height(np.array([row, row + 20.0])) == pytest.approx([0.0, 20.0 * slope])


def test_the_unit_of_the_file_is_that_of_its_homographies(tmp_path: Path) -> None:
    matrix = [[1.0, 0.0, 0.0], [0.0, 0.0, 50.0], [0.0, 1.0, 0.0]]
    (tmp_path / "ground.json").write_text(
        json.dumps({"unit": "m", "homography": {"c0": matrix, "c1": matrix}})
    )
    cameras = [{"id": "c0", "source": "a"}, {"id": "c1", "source": "b", "ground": matrix}]
    config = build_config({"cameras": cameras, "ground": "ground.json"}, where="site.yaml", folder=tmp_path)
    assert [camera.ground_unit for camera in config.cameras] == ["m", None]


@pytest.mark.parametrize("kind", ["background", "boxes", "hog"])
def test_frames_with_and_without_a_picture_have_histograms_of_one_length(tmp_path: Path, kind: str) -> None:
    one = observer(tmp_path, {"kind": kind})
    found = one.detect(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))
    assert found.histograms.shape == (0, one.appearance_bins)


def test_a_detection_file_takes_precedence_over_the_kind(tmp_path: Path) -> None:
    (tmp_path / "det.txt").write_text("1,-1,10,20,30,20,1,-1,-1,-1\n", encoding="utf-8")
    one = observer(tmp_path, {"kind": "hog"}, detections="det.txt")
    assert isinstance(one._file, MotFileDetector)
    assert len(one.detect(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))) == 1


@pytest.mark.parametrize(
    ("detect", "camera", "expected"),
    [
        ({"kind": "onnx"}, {}, "detect: onnx.model: kind onnx needs the path"),
        ({"kind": "fused"}, {}, "detect: onnx.model: kind fused needs the path"),
        ({"kind": "onnx", "onnx": {"model": "none.onnx"}}, {}, "camera c0: detect: "),
        ({"kind": "nobody"}, {}, "detect.kind: "),
        ({"hog": {"scale_step": 0.5}}, {}, "detect.hog: scale_step must be above 1"),
        ({"onnx": {"modle": "x"}}, {}, "did you mean 'model'?"),
        ({}, {"detections": "none.txt"}, "camera c0: detections: "),
    ],
)
def test_errors_are_reported_in_one_line(
    tmp_path: Path, detect: dict[str, Any], camera: dict[str, Any], expected: str
) -> None:
    with pytest.raises(UserError) as caught:
        observer(tmp_path, detect, **camera)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_networks_path_is_relative_to_the_configuration(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=str(tmp_path / "none.onnx")):
        observer(tmp_path, {"kind": "onnx", "onnx": {"model": "none.onnx"}})
