"""The samples and the result of the overload benchmark."""

from __future__ import annotations

from dataclasses import dataclass, field

RECOVERED_S = 180.0
"""Longest recovery that is waited for, seconds."""
_CARRIED_SHARE = 0.99
"""Share of searched frames from which the machine carries its cameras."""


@dataclass(frozen=True, slots=True)
class SiteSample:
    """The site at one moment.

    Attributes:
        at: seconds since the beginning.
        levels: of the cameras that are there.
        pulses: their newest frames, added up; of what follows likewise.
        shed: frames that were not searched.
        missed: pulses without a frame.
        late: windows that came too late.
        delays: milliseconds until pictures came to the viewer of a person, since the sample before.
        missing_frames: frames that viewers should have been shown and were not, so far.
    """

    at: float
    levels: tuple[int, ...]
    pulses: int
    shed: int
    missed: int
    late: int
    delays: tuple[float, ...]
    missing_frames: int


@dataclass(frozen=True, slots=True)
class LoadStep:
    """So many cameras, once they have settled.

    Attributes:
        cameras: how many.
        levels: the median of all cameras, and the highest one.
        searched: share of the frames.
        missed: share of the pulses.
        late: share of the windows.
        delays: milliseconds, p50 and p95.
        missing_frames: frames that viewers missed, the time of settling included.
    """

    cameras: int
    levels: tuple[float, int]
    searched: float
    missed: float
    late: float
    delays: tuple[float, float]
    missing_frames: int


@dataclass(slots=True)
class OverloadResult:
    """What was found."""

    samples: list[SiteSample] = field(default_factory=list)
    steps: list[LoadStep] = field(default_factory=list)
    started: list[tuple[float, int]] = field(default_factory=list)
    """When there were how many cameras."""
    recovery_s: float | None = None
    """Seconds from the killing until nothing was left out any more; None: it took too long."""

    @property
    def cameras_carried(self) -> int:
        """How many cameras the machine carries; 0: not one."""
        return max((step.cameras for step in self.steps if step.searched >= _CARRIED_SHARE), default=0)
