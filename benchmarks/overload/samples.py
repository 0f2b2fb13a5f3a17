"""What is found of a site to which cameras are added."""

from __future__ import annotations

from dataclasses import dataclass, field

RECOVERED_S = 180.0
"""For how long the way back is watched at most."""
_CARRIED = 0.99
"""Share of the frames that are searched where the machine carries its cameras."""


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
        holes: frames that viewers should have been shown and were not, so far.
    """

    at: float
    levels: tuple[int, ...]
    pulses: int
    shed: int
    missed: int
    late: int
    delays: tuple[float, ...]
    holes: int


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
        holes: frames that viewers missed, the time of settling included.
    """

    cameras: int
    levels: tuple[float, int]
    searched: float
    missed: float
    late: float
    delays: tuple[float, float]
    holes: int


@dataclass(slots=True)
class OverloadResult:
    """What was found."""

    samples: list[SiteSample] = field(default_factory=list)
    steps: list[LoadStep] = field(default_factory=list)
    started: list[tuple[float, int]] = field(default_factory=list)
    """When there were how many cameras."""
    back: float | None = None
    """Seconds from the killing until nothing was left out any more; None: it took too long."""

    @property
    def carried(self) -> int:
        """How many cameras the machine carries; 0: not one."""
        return max((it.cameras for it in self.steps if it.searched >= _CARRIED), default=0)
