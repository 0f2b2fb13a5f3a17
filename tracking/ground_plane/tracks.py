"""What joint tracking returns: the people of each frame, with their boxes in every camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tracking.boxes import Floats
from tracking.solvers.base import SolveReport


@dataclass(frozen=True, slots=True, eq=False)
class GroundBox:
    """A person's box in one camera.

    Attributes:
        box: (4,) pixels.
        detection: index of the detection; None: the box follows from the place.
    """

    box: Floats
    detection: int | None


@dataclass(frozen=True, slots=True, eq=False)
class GroundTrack:
    """A person in one frame.

    Attributes:
        id: from 1, never reused.
        place: (2,) in the unit of the plane.
        covariance: (2, 2) of the place.
        boxes: by camera: where they are detected, or should be.
    """

    id: int
    place: Floats
    covariance: Floats
    boxes: Mapping[str, GroundBox]


@dataclass(frozen=True, slots=True, eq=False)
class GroundFrame:
    """The people of a final frame, by ascending id, and what is proven about the window that decided it."""

    frame: int
    tracks: tuple[GroundTrack, ...]
    report: SolveReport | None
