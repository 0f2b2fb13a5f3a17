"""Settings of calibration from walks."""

from __future__ import annotations

from dataclasses import dataclass, fields

_STEP_S = 0.2
"""Seconds between the moments at which cameras are compared; people walk a sixth of their height in it."""
_MAXIMUM_OFFSET_S = 3.0


def comparison_step(fps: float) -> int:
    """Return the frames between the moments that are compared, over which boxes are averaged."""
    return max(1, round(_STEP_S * fps))


@dataclass(frozen=True, slots=True)
class WalkSettings:
    """Settings of the comparison of foot points, and thresholds that a calibration must reach.

    Lengths are in person heights, angles in radians.

    Raises:
        ValueError: a setting that is not above 0, or `maximum_offset` below it.
    """

    # Largest time offset between two cameras, frames; 0: they are synchronized.
    maximum_offset: int
    # Frames between the pulses that are compared.
    step: int
    # Standard deviations of foot points: in box heights, and on the floor in person heights.
    foot_sideways: float = 0.05
    foot_upwards: float = 0.15
    foot_floor: float = 0.15
    # Distance in standard deviations within which two foot points may be of one person ...
    gate: float = 2.0
    # ... and the same once the cameras are aligned.
    final_gate: float = 1.0
    # Spread of the heights of people's boxes: standard deviation of the logarithm.
    person_height_spread: float = 0.1
    # Priors of cameras: focal length in picture widths, and its spread (standard deviation of the logarithm);
    # spread of the ratio of a pixel's sides, and of the roll; height and its spread.
    focal: float = 0.85
    focal_spread: float = 0.35
    aspect_spread: float = 0.02
    roll_spread: float = 0.05
    camera_height: float = 2.0
    camera_height_spread: float = 1.0
    # Two cameras are placed on one floor if they agree at this many places (`stride` apart), if this share of
    # the samples that both could see is matched, if they agree this many times as well as with the walk of
    # one reversed in time or its halves swapped, and if this share of their agreement in each quarter of the
    # walk is left with the alignment that the other three give.
    minimum_places: float = 12.0
    stride: float = 0.15
    minimum_share: float = 0.45
    minimum_over_chance: float = 1.5
    minimum_held_out: float = 0.5
    # Largest median distance between their positions of a person.
    maximum_error: float = 0.25
    # Standard deviation of the walk across its main direction, below which it is a straight line.
    minimum_breadth: float = 0.25

    def __post_init__(self) -> None:
        """Check the ranges."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not (value >= 0 if field.name == "maximum_offset" else value > 0):
                raise ValueError(f"walk settings: {field.name}: {value} is not above 0")

    @classmethod
    def at_rate(cls, fps: float, maximum_offset_s: float = _MAXIMUM_OFFSET_S) -> WalkSettings:
        """Return the settings at a frame rate, for cameras out of sync by at most so many seconds."""
        return cls(round(maximum_offset_s * fps), comparison_step(fps))
