"""Settings of interactive tracking."""

from __future__ import annotations

from dataclasses import dataclass, fields

from tracking.frame_rate import frames_in

_RECENT_S = 3.0
"""Seconds whose boxes are used to predict risks."""
_SIZE_S = 2.0
"""Seconds before and after that determine the size of an object."""
_START_SHIFT_S = 0.2
"""Seconds by which a track that starts again may start earlier or later."""
_MAX_S = 1000.0
"""Limit of seconds back or ahead: message size and prediction time grow with them."""


@dataclass(frozen=True, slots=True)
class InteractiveSettings:
    """Settings of risk prediction and operator corrections.

    Raises:
        ValueError: a setting is out of range.
    """

    enabled: bool = False  # predict risks and accept operator corrections; false: no overhead
    memory_s: float = 10.0  # seconds back that a correction may change
    horizon_s: float = 1.0  # seconds ahead for which motion is extrapolated
    swap_margin: float = 1.0  # swap margin (cost) below which a past pair is at risk
    crossing_margin: float = 1.0  # swap margin (cost) below which a predicted crossing is at risk
    hidden_s: float = 0.4  # seconds after which an occluded object is at risk
    min_confidence: float = 0.15  # detection score below which an object is at risk, 0 to 1
    max_solver_gap: float = 0.01  # relative gap of a window above which its solution is at risk
    correction_weight: float = 2.0  # largest cost of a correction for an object at another position
    hidden_share: float = 0.25  # share of it that an occlusion costs the corrected object

    def __post_init__(self) -> None:
        if not all(0.0 < seconds <= _MAX_S for seconds in (self.memory_s, self.horizon_s, self.hidden_s)):
            raise ValueError(f"memory_s, horizon_s and hidden_s must be above 0, and at most {_MAX_S:g} s")
        if (
            not min(self.swap_margin, self.crossing_margin, self.max_solver_gap, self.correction_weight)
            >= 0.0
        ):
            raise ValueError(
                "swap_margin, crossing_margin, max_solver_gap and correction_weight must not be negative"
            )
        for name in ("min_confidence", "hidden_share"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is a share between 0 and 1, not {getattr(self, name)}")

    def resolve(self, fps: float) -> ResolvedInteractiveSettings:
        """Return the settings with all times also in frames, for so many frames per second."""
        return ResolvedInteractiveSettings(
            **{field.name: getattr(self, field.name) for field in fields(InteractiveSettings)},
            memory_frames=frames_in(self.memory_s, fps),
            horizon_frames=frames_in(self.horizon_s, fps),
            hidden_frames=frames_in(self.hidden_s, fps),
            recent_frames=frames_in(_RECENT_S, fps),
            size_frames=frames_in(_SIZE_S, fps),
            start_shift=frames_in(_START_SHIFT_S, fps),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedInteractiveSettings(InteractiveSettings):
    """Settings for one frame rate: each time is also given as a number of frames."""

    memory_frames: int
    horizon_frames: int
    hidden_frames: int
    recent_frames: int
    size_frames: int
    start_shift: int
