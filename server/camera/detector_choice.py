"""Chooses the detector where the configuration leaves it open, and says what was chosen."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

from server.config.sections import CameraSettings
from server.config.sections.detect import DetectSettings
from server.models.catalog import MODELS
from server.models.installed import is_installed
from tracking.detectors import BackgroundDetector, Detector, FusedDetector, HogDetector, OnnxDetector

_DRAWN = "scene:"
"""The beginning of a source that draws its people, which no network knows."""


def choose_detector(settings: DetectSettings, camera: CameraSettings) -> DetectSettings:
    """Return settings with a kind other than ``auto``.

    A network that is named, or else the first installed one of the catalog, is used together with the
    background. Without one, without onnxruntime, for a camera that looks straight down and for drawn scenes
    the background detects alone.
    """
    if settings.kind != "auto":
        return settings
    background = replace(settings, kind="background")
    if camera.kind == "overhead" or camera.source.startswith(_DRAWN):
        return background
    if settings.onnx.model is not None:
        return replace(settings, kind="fused")
    installed = next((model for model in MODELS if is_installed(model)), None)
    if installed is None or find_spec("onnxruntime") is None:
        return background
    return replace(settings.with_installed(installed), kind="fused")


def describe_detector(detector: Detector) -> str:
    """Return what detects people, for the log."""
    match detector:
        case FusedDetector(network=OnnxDetector() as network, frames_per_run=every):
            often = "every frame" if every == 1 else f"every {every} frames"
            return f"background and {_describe_network(network)}, {often}"
        case OnnxDetector():
            return _describe_network(detector)
        case BackgroundDetector():
            return "background"
        case HogDetector():
            return "hog"
        case _:
            return "a detection file"


def _describe_network(network: OnnxDetector) -> str:
    model = network.settings.model
    runs_on = "; ".join([network.provider, *(f"not {failure}" for failure in network.failed_providers)])
    return f"network {model.stem if model else ''} ({runs_on})"
