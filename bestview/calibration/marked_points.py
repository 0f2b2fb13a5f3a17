"""Marked points of a camera, and the tolerance for contradictions between them."""

from __future__ import annotations

from dataclasses import dataclass

from bestview.calibration.homography import Floats


class CalibrationError(ValueError):
    """No calibration is possible; the text is one line: why, and what would help."""


@dataclass(frozen=True, slots=True)
class PointSettings:
    """When marked points contradict each other.

    Raises:
        ValueError: a setting outside its range.
    """

    # How far a pair may be off in the picture, as a share of how far the camera's points are spread there.
    tolerance: float = 0.02
    # The most pairs that may be named as wrong, as a share; where more would have to be, all are doubtful.
    maximum_inconsistent_share: float = 0.34

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 < self.tolerance < 1 or not 0 <= self.maximum_inconsistent_share < 1:
            raise ValueError("point settings: tolerance and wrong are shares, above 0 and below 1")


@dataclass(frozen=True, slots=True)
class MarkedPoints:
    """The marked pairs of one camera.

    Attributes:
        camera: its name, for messages.
        image: pixels of the camera's own picture, (N, 2).
        floor: the same places on the floor, (N, 2), in the user's unit.
    """

    camera: str
    image: Floats
    floor: Floats
