"""Load shedding: how much work a camera leaves out on an overloaded machine. Has no clock.

Detection costs most, so it is skipped first. A live camera then takes fewer frames, and the stream fills the
gaps.
"""

from __future__ import annotations

from dataclasses import dataclass

_SEARCHED = (1, 2, 3)
_UP_AFTER_S = 0.5
"""Seconds that tracking must lag, without catching up, before the next level."""
_DOWN_AFTER_S, _DOWN_MOST_S = 5.0, 60.0
"""Seconds that it must keep up before the level below is tried, and the most after failed tries."""
_TOO_SOON = 4.0
_CATCHES_UP = 0.95
"""A lag below this share of the earlier one is catching up."""


@dataclass(frozen=True, slots=True)
class ShedLevel:
    """How much work one level leaves out.

    Attributes:
        searched: detection runs on one in so many frames, counted back from the end of each window.
        taken: one in so many frames is taken.
    """

    searched: int = 1
    taken: int = 1

    def searches(self, pulse: int, stride: int) -> bool:
        """Return whether detection runs on a frame; it always does on the last frame of a window."""
        return -(pulse + 1) % stride % self.searched == 0

    def takes(self, pulse: int, stride: int, gop: int) -> bool:
        """Return whether a frame is taken: always the first of a GOP and the last of a window."""
        return pulse % gop % self.taken == 0 or (pulse + 1) % stride == 0

    @property
    def description(self) -> str:
        """What is shed, in words; empty: nothing."""
        if self.searched == 1:
            return ""
        which = _ORDINALS.get(self.searched, f"{self.searched}th")
        shown = "" if self.taken == 1 else "showing every 2nd and "
        return f"{shown}searching every {which} frame: the machine is too busy"


_ORDINALS = {2: "2nd", 3: "3rd"}


def shed_levels(stride: int, *, live: bool) -> tuple[ShedLevel, ...]:
    """Return the levels from 0 up, for windows that end every ``stride`` frames.

    Frames of a recording are always taken.
    """
    searched = sorted({it for it in _SEARCHED if it <= stride} | {stride})
    found = [ShedLevel(it) for it in searched]
    return (*found, ShedLevel(searched[-1], 2)) if live else tuple(found)


@dataclass(frozen=True, slots=True)
class LevelBounds:
    """The lags at which the level changes.

    Attributes:
        behind_s: a larger lag raises the level.
        keeps_up_s: a smaller lag lowers it.
    """

    behind_s: float
    keeps_up_s: float


class LoadShedder:
    """Chooses the level: up at once, down slowly, and more slowly after going down too early."""

    def __init__(self, shed_levels: tuple[ShedLevel, ...], bounds: LevelBounds) -> None:
        self._levels, self._bounds = shed_levels, bounds
        self.level = 0
        self._behind_since: float | None = None
        self._behind_by = 0.0
        self._keeps_up_since: float | None = None
        self._patience = _DOWN_AFTER_S
        self._went_down = -_DOWN_MOST_S

    @property
    def current(self) -> ShedLevel:
        """The level's settings."""
        return self._levels[self.level]

    def measure_lag(self, lag: float, now: float) -> None:
        """Update with tracking's lag behind the pulses in seconds, at a monotonic time."""
        if lag > self._bounds.behind_s:
            self._keeps_up_since = None
            self._behind(lag, now)
            return
        self._behind_since = None
        if lag > self._bounds.keeps_up_s:
            self._keeps_up_since = None
        elif self._keeps_up_since is None:
            self._keeps_up_since = now
        elif now - self._keeps_up_since >= self._patience and self.level:
            self.level -= 1
            self._patience = max(self._patience / 2.0, _DOWN_AFTER_S)
            self._went_down, self._keeps_up_since = now, now

    def _behind(self, lag: float, now: float) -> None:
        if self._behind_since is None:
            self._behind_since, self._behind_by = now, lag
        elif now - self._behind_since >= _UP_AFTER_S:
            if lag > _CATCHES_UP * self._behind_by:
                self._up(now)
            self._behind_since, self._behind_by = now, lag

    def _up(self, now: float) -> None:
        if self.level == len(self._levels) - 1:
            return
        self.level += 1
        if now - self._went_down < _DOWN_MOST_S:
            self._patience = min(_TOO_SOON * self._patience, _DOWN_MOST_S)
