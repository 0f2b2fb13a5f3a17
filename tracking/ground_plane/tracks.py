"""What joint tracking returns: the people of each frame, with their boxes in every camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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
    """The people of a final frame.

    Attributes:
        frame: its number.
        tracks: by ascending id.
        report: what is proven about the window that decided it; None: nothing was decided.
        exchanged: by id, the id under which the person was tracked until the frame before, of people who had
            been taken for each other.
    """

    frame: int
    tracks: tuple[GroundTrack, ...]
    report: SolveReport | None
    exchanged: Mapping[int, int] = field(default_factory=dict)
