"""Settings of calibration from walks."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class WalkSettings:
    """How people's foot points are compared, and when that is enough for a calibration.

    Lengths are in person heights, angles in radians.

    Raises:
        ValueError: a setting that is not above 0, or `maximum_offset` below it.
    """

    # Frames that a camera may be early or late against another; 0: they are in step.
    maximum_offset: int = 75
    # Frames between the moments at which feet are compared.
    step: int = 5
    # How well boxes find the feet, standard deviations in box heights, and on the floor in person heights.
    foot_sideways: float = 0.05
    foot_upwards: float = 0.15
    foot_floor: float = 0.15
    # Feet within so many standard deviations of each other may be one person's.
    gate: float = 2.0
    # ... and within so many they surely stand at one place, once the cameras are where they should be.
    final_gate: float = 1.0
    # How much people's boxes differ in height: standard deviation of the logarithm.
    person_height_spread: float = 0.1
    # What cameras are usually like: focal length in picture widths, and how far it may be from that (standard
    # deviation of the logarithm); the same of the ratio of a pixel's sides, of the roll, and of the height.
    focal: float = 0.85
    focal_spread: float = 0.35
    aspect_spread: float = 0.02
    roll_spread: float = 0.05
    camera_height: float = 2.0
    camera_height_spread: float = 1.0
    # Two cameras belong together if they agree at so many places at least (a place is `stride` from the one
    # before), about so large a share of all that both could see, and so many times as well as they do when
    # the other's walk is run backwards, or its second half first.
    minimum_places: float = 12.0
    stride: float = 0.15
    minimum_share: float = 0.45
    minimum_over_chance: float = 1.5
    # ... and have people at one place to within this (median).
    maximum_error: float = 0.25
    # A walk less broad than this is a line (standard deviation of its places across its main direction).
    minimum_breadth: float = 0.25

    def __post_init__(self) -> None:
        """Check the ranges."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not (value >= 0 if field.name == "maximum_offset" else value > 0):
                raise ValueError(f"walk settings: {field.name}: {value} is not above 0")
