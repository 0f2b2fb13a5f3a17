"""Load shedding: how much work a camera leaves out on an overloaded machine. Has no clock.

Detection costs most. A network, between whose runs silhouettes detect, runs less often first; then
detection skips frames. A live camera finally captures fewer frames, and the stream fills the gaps.
"""

from __future__ import annotations

from dataclasses import dataclass

_NETWORK_FACTORS = (2, 4)
_DETECTION_INTERVALS = (1, 2, 3)
_CAPTURE_INTERVALS = (2, 4)
_UP_AFTER_S = 0.5
"""Seconds that tracking must lag, without catching up, before the next level."""
_DOWN_AFTER_S, _DOWN_MAX_S = 5.0, 60.0
"""Seconds that it must keep up before the level below is tried, and their maximum after failed tries."""
_RETRY_FACTOR = 4.0
"""Factor of that time after a level was lowered too early."""
_CATCHES_UP = 0.95
"""Below this share of the earlier lag, tracking is catching up."""


@dataclass(frozen=True, slots=True)
class ShedLevel:
    """How much work one level leaves out.

    Attributes:
        network_factor: factor of the interval between two runs of a network beside the background.
        detection_interval: detection runs on one in so many frames, counted back from the end of each window.
        capture_interval: one in so many frames is captured.
    """

    network_factor: int = 1
    detection_interval: int = 1
    capture_interval: int = 1

    def detects(self, pulse: int, stride: int) -> bool:
        """Return whether detection runs on a frame; it always does on the last frame of a window."""
        return -(pulse + 1) % stride % self.detection_interval == 0

    def captures(self, pulse: int, stride: int, gop: int) -> bool:
        """Return whether a frame is captured; the first of a GOP and the last of a window always are."""
        return pulse % gop % self.capture_interval == 0 or (pulse + 1) % stride == 0

    @property
    def description(self) -> str:
        """The shed work as text; empty: none."""
        if self.detection_interval > 1:
            detection = f"detecting in every {_ordinal(self.detection_interval)} frame"
            capture = f"showing every {_ordinal(self.capture_interval)} and " * (self.capture_interval > 1)
            return f"{capture}{detection}: the machine is too busy"
        if self.network_factor > 1:
            return f"running the network {self.network_factor} times less often: the machine is too busy"
        return ""


_ORDINAL_ENDINGS = {2: "nd", 3: "rd"}


def _ordinal(number: int) -> str:
    return f"{number}{_ORDINAL_ENDINGS.get(number, 'th')}"


def shed_levels(stride: int, *, live: bool, has_network: bool = False) -> tuple[ShedLevel, ...]:
    """Return the levels from 0 up, for windows that end every ``stride`` frames.

    Args:
        stride: frames from the end of one window to that of the next.
        live: whether frames may be left out of the stream; those of a recording are all captured.
        has_network: whether a network detects beside the background.
    """
    factors = _NETWORK_FACTORS if has_network else ()
    intervals = sorted({interval for interval in _DETECTION_INTERVALS if interval <= stride} | {stride})
    levels = [ShedLevel(), *(ShedLevel(factor) for factor in factors)]
    factor = levels[-1].network_factor
    levels += [ShedLevel(factor, interval) for interval in intervals[1:]]
    captures = _CAPTURE_INTERVALS if live and stride > 1 else ()
    return (*levels, *(ShedLevel(factor, intervals[-1], capture) for capture in captures))


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
        self._down_after_s = _DOWN_AFTER_S
        self._lowered_at = -_DOWN_MAX_S

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
        elif now - self._keeps_up_since >= self._down_after_s and self.level:
            self.level -= 1
            self._down_after_s = max(self._down_after_s / 2.0, _DOWN_AFTER_S)
            self._lowered_at, self._keeps_up_since = now, now

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
        if now - self._lowered_at < _DOWN_MAX_S:
            self._down_after_s = min(_RETRY_FACTOR * self._down_after_s, _DOWN_MAX_S)
