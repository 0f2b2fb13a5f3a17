"""Settings of interactive tracking."""

from __future__ import annotations

from dataclasses import dataclass

_MAX_FRAMES = 10_000
"""Limit of frames back or ahead: message size and prediction time grow with them."""


@dataclass(frozen=True, slots=True)
class InteractiveSettings:
    """Settings of risk prediction and operator corrections.

    Raises:
        ValueError: a setting is out of range.
    """

    enabled: bool = False  # predict risks and accept operator corrections; false: no overhead
    memory_frames: int = 250  # frames back that a correction may change
    horizon_frames: int = 25  # frames ahead for which motion is extrapolated
    swap_margin: float = 1.0  # swap margin (cost) below which a past pair is at risk
    crossing_margin: float = 1.0  # swap margin (cost) below which a predicted crossing is at risk
    hidden_frames: int = 10  # frames after which an occluded object is at risk
    min_confidence: float = 0.15  # detection score below which an object is at risk, 0 to 1
    max_solver_gap: float = 0.01  # relative gap of a window above which its solution is at risk
    correction_weight: float = 2.0  # largest cost of a correction for an object at another position
    hidden_share: float = 0.25  # share of it that an occlusion costs the corrected object

    def __post_init__(self) -> None:
        if not all(
            1 <= frames <= _MAX_FRAMES
            for frames in (self.memory_frames, self.horizon_frames, self.hidden_frames)
        ):
            raise ValueError(
                f"memory_frames, horizon_frames and hidden_frames must be 1 to {_MAX_FRAMES} frames"
            )
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
