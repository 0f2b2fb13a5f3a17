"""Settings of joint tracking on a ground plane, in meters and seconds whatever the unit of the plane is."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from tracking.boxes import Floats

_MAY_BE_ANY = {"appearance", "unknown_appearance", "covered_log_odds"}


@dataclass(frozen=True, slots=True)
class GroundSettings:
    """Probabilities and rates from which all costs of the program follow; none is tuned to a scene.

    Raises:
        ValueError: a setting is out of range.
    """

    frame_s: float = 0.12  # seconds between two frames of the program; boxes in between are interpolated
    lag_s: float = 0.4  # seconds that a frame waits for later ones before it is final; at least one frame
    stride_s: float = 0.2  # seconds between two solutions
    correlation_s: float = 0.9  # seconds in which detectors err alike: detections in them count as one
    detection_probability: float = 0.9  # of a person that nothing hides, in one camera and frame
    false_per_frame: float = 0.5  # false detections per picture
    covered_log_odds: float = 2.0  # log odds lost by a detection that a better one of its camera covers
    people_density: float = 0.05  # people per square meter who are there at the beginning
    beginning_s: float = 2.0  # seconds after the first detection in which they may still be found
    arrival_rate: float = 0.004  # people who appear per square meter and second, later
    departure_rate: float = 0.1  # share of the people that leaves per second
    foot_noise: float = 0.012  # standard deviation of a foot, box heights, before it is known per camera
    calibration_noise: float = 0.1  # standard deviation by which cameras disagree about a place, meters
    speed: float = 1.3  # standard deviation of the velocity of people who start, stop and turn, meters/s
    acceleration: float = 0.8  # standard deviation of the acceleration of those who walk on, meters/s²
    turn_rate: float = 0.06  # times per second that somebody starts, stops or turns
    forget_after_s: float = 2.0  # seconds unseen after which somebody has left
    forget_unclear_after_s: float = (
        3.0  # seconds seen by unlikely detections alone after which they have left
    )
    appearance: float = 8.0  # weight of the distance to a person's appearance in a camera
    misplaced_probability: float = (
        0.05  # of the feet of a person's box being wrong: hidden, in a shadow, cut off
    )
    unknown_appearance: float = 0.3  # distance at which an appearance says nothing

    def __post_init__(self) -> None:
        if not 0.0 < self.detection_probability < 1.0:
            raise ValueError(
                f"detection_probability is a probability between 0 and 1, not {self.detection_probability}"
            )
        if self.misplaced_probability >= 1.0:
            raise ValueError(f"misplaced_probability must be below 1, not {self.misplaced_probability}")
        for field in fields(self):
            if field.name not in _MAY_BE_ANY and not getattr(self, field.name) > 0.0:
                raise ValueError(f"{field.name} must be above 0, not {getattr(self, field.name)}")

    def turn_probability(self, seconds: float | Floats) -> Floats:
        """Return the probability that somebody starts, stops or turns within so many seconds."""
        return np.asarray(-np.expm1(-self.turn_rate * np.asarray(seconds)))

    def misplacing_probability(self, seconds: float | Floats) -> Floats:
        """Return the probability that feet begin or end to be in the wrong place within so many seconds."""
        return np.asarray(-np.expm1(-self.misplaced_probability / self.correlation_s * np.asarray(seconds)))

    def detection_weight(self, seconds: float) -> float:
        """Return for how much a frame's detections and misses count beside those that err on their own.

        Frames are `seconds` apart.
        """
        return min(seconds / self.correlation_s, 1.0)
