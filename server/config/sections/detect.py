"""The section `detect`: the detector and its settings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, Self

from server.models.catalog import InstallableModel, find_model
from server.models.installed import network_path
from tracking.detectors import BackgroundSettings, FusedSettings, HogSettings, OnnxSettings

_MIN_PROBABILITY = 0.05
"""The default `onnx.min_score` of installed networks."""

DetectorKind = Literal["auto", "background", "boxes", "hog", "onnx", "fused"]


@dataclass(frozen=True, slots=True)
class DetectSettings(BackgroundSettings):
    """Settings of the background detector and of the detectors that can replace it."""

    kind: DetectorKind = "auto"  # auto: fused if a network is installed or named, otherwise background
    hog: HogSettings = field(default_factory=HogSettings)
    onnx: OnnxSettings = field(default_factory=OnnxSettings)
    fused: FusedSettings = field(default_factory=FusedSettings)

    def __post_init__(self) -> None:
        BackgroundSettings.__post_init__(self)
        if self.kind in {"onnx", "fused"} and self.onnx.model is None:
            needed = "the path of an ONNX file, or the name of an installed network"
            raise ValueError(f"onnx.model: kind {self.kind} needs {needed}")

    def onnx_in(self, folder: Path) -> OnnxSettings:
        """Return the network's settings; its file is relative to ``folder``, or an installed one."""
        if self.onnx.model is None:
            return self.onnx
        installable = find_model(str(self.onnx.model))
        if installable is None:
            return replace(self.onnx, model=folder / self.onnx.model)
        return self.with_installed(installable).onnx

    def with_installed(self, model: InstallableModel) -> Self:
        """Return the settings with the file of an installed network."""
        # Scores of installed networks are probabilities, and the tracker makes use of doubtful boxes.
        min_score = _MIN_PROBABILITY if self.onnx.min_score is None else self.onnx.min_score
        onnx = replace(self.onnx, model=network_path(model), resize=model.resize, min_score=min_score)
        return replace(self, onnx=onnx)
