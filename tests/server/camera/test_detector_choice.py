"""The default detector: a network with the background if one is installed, otherwise the background alone."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import pytest

from fakes.tracking.tiny_networks import save_network, yolov8
from server.camera import detector_choice
from server.camera.detector_choice import choose_detector, describe_detector
from server.camera.detector_setup import make_prescanned_detector
from server.camera.sources import open_source
from server.config.loader import build_config
from server.config.sections.detect import DetectSettings
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.models.catalog import MODELS
from tracking.detectors import OnnxDetector, OnnxSettings


def config_of(detect: dict[str, Any] | None = None, **camera: Any) -> Config:
    cameras = [{"id": "c0", "source": "a.mp4", **camera}]
    return build_config({"cameras": cameras, "detect": detect or {}}, where="site.yaml", folder=Path())


def chosen(detect: dict[str, Any] | None = None, **camera: Any) -> DetectSettings:
    config = config_of(detect, **camera)
    return choose_detector(config.detect, config.cameras[0])


@pytest.fixture
def networks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make a folder of installed networks, with the last two of the catalog."""
    monkeypatch.setenv("MYVIEW_MODELS", str(tmp_path))
    for model in MODELS[1:]:
        save_network(tmp_path / f"{model.name}.onnx", yolov8([(30.0, 32.0, 12.0, 40.0, 0.72)]))
    return tmp_path


def test_without_a_network_the_background_detects() -> None:
    assert chosen().kind == "background"


def test_the_first_installed_network_of_the_catalog_detects_with_the_background(networks: Path) -> None:
    settings = chosen()
    assert (settings.kind, settings.onnx.model) == ("fused", networks / f"{MODELS[1].name}.onnx")
    assert (settings.onnx.resize, settings.onnx.min_score) == (MODELS[1].resize, 0.05)
    assert chosen({"onnx": {"model": MODELS[2].name}}).onnx.model == networks / f"{MODELS[2].name}.onnx"
    assert chosen({"onnx": {"min_score": 0.25}}).onnx.min_score == 0.25


def test_a_named_file_is_used_with_the_background() -> None:
    settings = chosen({"onnx": {"model": "own.onnx"}})
    assert (settings.kind, settings.onnx.model) == ("fused", Path("own.onnx"))


def test_other_kinds_are_kept(networks: Path) -> None:
    assert networks.exists()
    for kind in ("background", "boxes", "hog"):
        assert chosen({"kind": kind}).kind == kind


def test_drawn_scenes_and_cameras_that_look_straight_down_have_no_network(networks: Path) -> None:
    assert networks.exists()
    assert chosen(source="scene:room").kind == "background"
    assert chosen(kind="overhead").kind == "background"


def test_without_onnxruntime_the_background_detects(networks: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert networks.exists()
    monkeypatch.setattr(detector_choice, "find_spec", lambda _name: None)
    assert chosen().kind == "background"


def test_the_start_says_what_detects(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    save_network(tmp_path / "own.onnx", yolov8([(30.0, 32.0, 12.0, 40.0, 0.72)]))
    config = config_of(
        {"kind": "fused", "onnx": {"model": str(tmp_path / "own.onnx"), "provider": "cpu"}},
        source="scene:room",
    )
    caplog.set_level(logging.INFO)
    camera = config.cameras[0]
    source = open_source(camera, config.site)
    make_prescanned_detector(config, camera, source, Letterbox(source.size, source.size))
    source.close()
    line = "camera c0: people are detected by: background and network own (CPU), every 5 frames"
    assert line in caplog.messages


def test_the_start_says_which_provider_could_not_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_network(tmp_path / "own.onnx", yolov8([(30.0, 32.0, 12.0, 40.0, 0.72)]))
    detector = OnnxDetector(OnnxSettings(model=tmp_path / "own.onnx", provider="cpu"))
    assert describe_detector(detector) == "network own (CPU)"
    monkeypatch.setattr(OnnxDetector, "failed_providers", ("CUDA: libcuda.so.1: cannot open",))
    assert describe_detector(detector) == "network own (CPU; not CUDA: libcuda.so.1: cannot open)"
