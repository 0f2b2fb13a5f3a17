"""The settings of the operator's help."""

from __future__ import annotations

from dataclasses import dataclass

_MOST_FRAMES = 10_000
"""Frames back, or ahead: messages, and what is worked out of a window, grow with them."""


@dataclass(frozen=True, slots=True)
class AssistSettings:
    """What is foreseen, and what pointing weighs.

    Raises:
        ValueError: a number makes no sense.
    """

    enabled: bool = False  # troubles are foreseen and pointings taken; off, it costs nothing
    memory: int = 250  # frames back that a pointing may mend; detections and object lists are kept for them
    horizon: int = 25  # frames ahead for which people are taken to go on as they went
    margin: float = 1.0  # cost difference below which two who may have been exchanged are a trouble
    alike: float = 1.0  # the same of two who are about to cross, as far as it can be told before
    gone: int = 10  # frames after which somebody hidden is a trouble
    faint: float = 0.15  # score below which somebody fades; scores are in [0, 1]
    gap: float = 0.01  # gap of a window (relative) above which its answer is a trouble
    weight: float = 2.0  # most that one pointing can cost an object that is elsewhere
    hidden: float = 0.25  # share of it that being hidden costs who is pointed at

    def __post_init__(self) -> None:
        if not all(1 <= it <= _MOST_FRAMES for it in (self.memory, self.horizon, self.gone)):
            raise ValueError(f"memory, horizon and gone must be 1 to {_MOST_FRAMES} frames")
        if not min(self.margin, self.alike, self.gap, self.weight) >= 0.0:
            raise ValueError("margin, alike, gap and weight must not be negative")
        for name in ("faint", "hidden"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is a share between 0 and 1, not {getattr(self, name)}")
