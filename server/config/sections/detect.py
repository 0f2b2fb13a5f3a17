"""Which detector looks for people, and its settings: the section `detect`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from tracking.detectors import BackgroundSettings, HogSettings, OnnxSettings

DetectorKind = Literal["background", "boxes", "hog", "onnx"]


@dataclass(frozen=True, slots=True)
class DetectSettings(BackgroundSettings):
    """The background detector's settings, and those of the detectors that may take its place."""

    kind: DetectorKind = "background"  # boxes: background without what is not in the paper
    hog: HogSettings = field(default_factory=HogSettings)
    onnx: OnnxSettings = field(default_factory=OnnxSettings)

    def __post_init__(self) -> None:
        BackgroundSettings.__post_init__(self)
        if self.kind == "onnx" and self.onnx.model is None:
            raise ValueError("onnx.model: kind onnx needs the path of an ONNX file")

    def model_in(self, folder: Path) -> Path | None:
        """Return the path of the network's file, which is relative to the configuration's folder."""
        return None if self.onnx.model is None else folder / self.onnx.model
