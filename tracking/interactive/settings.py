"""The settings of the operator's help."""

from __future__ import annotations

from dataclasses import dataclass

_MOST_FRAMES = 10_000
"""Frames back, or ahead: messages, and what is worked out of a window, grow with them."""


@dataclass(frozen=True, slots=True)
class InteractiveSettings:
    """What is foreseen, and what pointing weighs.

    Raises:
        ValueError: a number makes no sense.
    """

    enabled: bool = False  # troubles are foreseen and pointings taken; off, it costs nothing
    memory_frames: int = (
        250  # frames back that a pointing may mend; detections and object lists are kept for them
    )
    horizon_frames: int = 25  # frames ahead for which people are taken to go on as they went
    swap_margin: float = 1.0  # cost difference below which two who may have been exchanged are a trouble
    crossing_margin: float = 1.0  # the same of two who are about to cross, as far as it can be told before
    hidden_frames: int = 10  # frames after which somebody hidden is a trouble
    min_confidence: float = 0.15  # score below which somebody fades; scores are in [0, 1]
    max_solver_gap: float = 0.01  # gap of a window (relative) above which its answer is a trouble
    correction_weight: float = 2.0  # most that one pointing can cost an object that is elsewhere
    hidden_share: float = 0.25  # share of it that being hidden costs who is pointed at

    def __post_init__(self) -> None:
        if not all(
            1 <= it <= _MOST_FRAMES for it in (self.memory_frames, self.horizon_frames, self.hidden_frames)
        ):
            raise ValueError(
                f"memory_frames, horizon_frames and hidden_frames must be 1 to {_MOST_FRAMES} frames"
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
