"""The scenes of the experiments: ground truth and detections of every frame."""

from __future__ import annotations

from dataclasses import dataclass

from tracking import Detections, Template
from tracking.boxes import Floats

WIDTH, HEIGHT = 352, 288
"""CIF, as in the paper (IV.A)."""

CENTER = (WIDTH / 2.0, HEIGHT / 2.0)
"""Where the layout term places a hidden object (II.D)."""


@dataclass(frozen=True, slots=True, eq=False)
class ObjectTruth:
    """The ground truth of n objects in T frames.

    Attributes:
        boxes: `(n, T, 4)` pixels, whole boxes, occluded or not; NaN while the object is out of the picture.
        visible: `(n, T)`, unoccluded share of the box; 0 out of the picture.
    """

    boxes: Floats
    visible: Floats

    @property
    def objects(self) -> int:
        """The number n of objects."""
        return int(self.boxes.shape[0])

    @property
    def frames(self) -> int:
        """The number T of frames."""
        return int(self.boxes.shape[1])


@dataclass(frozen=True, slots=True, eq=False)
class ExperimentScene:
    """One synthetic recording.

    Attributes:
        truth: the ground truth.
        seen: `seen[p][t]` are the observations of frame t; one set p for all objects, or one for each.
        templates: the objects in frame 0; empty where they must be detected.
        kits: the kit number of each object; objects of one kit look alike.
    """

    truth: ObjectTruth
    seen: tuple[tuple[Detections, ...], ...]
    templates: tuple[Template, ...]
    kits: tuple[int, ...]

    @property
    def observations(self) -> float:
        """The mean number of observations per frame in a set."""
        counts = [len(frame) for frames in self.seen for frame in frames]
        return sum(counts) / len(counts)
