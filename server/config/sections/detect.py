"""The section `detect`: the detector and its settings."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from tracking.detectors import BackgroundSettings, HogSettings, OnnxSettings

DetectorKind = Literal["background", "boxes", "hog", "onnx"]


@dataclass(frozen=True, slots=True)
class DetectSettings(BackgroundSettings):
    """Settings of the background detector and of the detectors that can replace it."""

    kind: DetectorKind = "background"  # boxes: the background detector of the paper, without extensions
    hog: HogSettings = field(default_factory=HogSettings)
    onnx: OnnxSettings = field(default_factory=OnnxSettings)

    def __post_init__(self) -> None:
        BackgroundSettings.__post_init__(self)
        if self.kind == "onnx" and self.onnx.model is None:
            raise ValueError("onnx.model: kind onnx needs the path of an ONNX file")

    def model_in(self, folder: Path) -> Path | None:
        """Return the path of the ONNX file, which is relative to the configuration's folder."""
        return None if self.onnx.model is None else folder / self.onnx.model
