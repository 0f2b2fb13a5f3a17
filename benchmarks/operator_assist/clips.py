"""The clips that an operator helps with: what a detector saw in every frame, and who is really where."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.paper_experiments.scene import ObjectTruth
from tracking import Detections


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """One recording of one camera.

    Attributes:
        seed: what it was made from.
        fps: frames a second.
        seen: what was found, frame by frame.
        truth: who is where.
    """

    seed: int
    fps: float
    seen: tuple[Detections, ...]
    truth: ObjectTruth

    @property
    def minutes(self) -> float:
        """How long it is."""
        return len(self.seen) / self.fps / 60.0
