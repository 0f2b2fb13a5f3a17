"""The clips of the benchmark: detections and ground truth of every frame."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.paper_experiments.scene import ObjectTruth
from tracking import Detections


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A recording of one camera.

    Attributes:
        seed: of the random generator.
        fps: frames per second.
        detections: of each frame.
        truth: the ground truth.
    """

    seed: int
    fps: float
    detections: tuple[Detections, ...]
    truth: ObjectTruth

    @property
    def minutes(self) -> float:
        """The length in minutes."""
        return len(self.detections) / self.fps / 60.0
