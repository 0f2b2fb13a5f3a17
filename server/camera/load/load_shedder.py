"""The load ladder: how much a camera leaves out on a machine with too much to do. It has no clock.

Detection is what costs, so that goes first: fewer frames are searched. The picture goes last, and never as a
whole: a live camera takes fewer frames, and the stream bridges those that are not taken.
"""

from __future__ import annotations

from dataclasses import dataclass

_SEARCHED = (1, 2, 3)
_UP_AFTER_S = 0.5
"""How long tracking must be behind, and not catch up, before the next rung."""
_DOWN_AFTER_S, _DOWN_MOST_S = 5.0, 60.0
"""How long it must keep up before the rung below is tried: longer where that was too soon."""
_TOO_SOON = 4.0
_CATCHES_UP = 0.95
"""Being behind by less than this part of what it was is catching up."""


@dataclass(frozen=True, slots=True)
class ShedLevel:
    """How much of the work a level leaves out.

    Attributes:
        searched: one in so many frames is searched for people, counted back from the end of each window.
        taken: one in so many frames is taken at all.
    """

    searched: int = 1
    taken: int = 1

    def searches(self, pulse: int, stride: int) -> bool:
        """Return whether a frame is searched. The last one of every window is."""
        return -(pulse + 1) % stride % self.searched == 0

    def takes(self, pulse: int, stride: int, gop: int) -> bool:
        """Return whether a frame is searched: always the first of a GOP, and the last of a window."""
        return pulse % gop % self.taken == 0 or (pulse + 1) % stride == 0

    @property
    def words(self) -> str:
        """What is left out, for people; empty: nothing."""
        if self.searched == 1:
            return ""
        which = _ORDINALS.get(self.searched, f"{self.searched}th")
        shown = "" if self.taken == 1 else "showing every 2nd and "
        return f"{shown}searching every {which} frame: the machine is too busy"


_ORDINALS = {2: "2nd", 3: "3rd"}


def shed_levels(stride: int, *, live: bool) -> tuple[ShedLevel, ...]:
    """Return the levels from 0 up, for windows that end every ``stride`` frames.

    Frames of a recording are always taken: whoever watches it again would miss them.
    """
    searched = sorted({it for it in _SEARCHED if it <= stride} | {stride})
    found = [ShedLevel(it) for it in searched]
    return (*found, ShedLevel(searched[-1], 2)) if live else tuple(found)


@dataclass(frozen=True, slots=True)
class LevelBounds:
    """When a level is left.

    Attributes:
        behind_s: tracking is too far behind the pulses: upwards.
        abreast_s: it keeps up: downwards.
    """

    behind_s: float
    abreast_s: float


class LoadShedder:
    """Chooses the level: up at once, down slowly, and more slowly where going down was too early."""

    def __init__(self, shed_levels: tuple[ShedLevel, ...], bounds: LevelBounds) -> None:
        self._rungs, self._bounds = shed_levels, bounds
        self.level = 0
        self._behind_since: float | None = None
        self._behind_by = 0.0
        self._abreast_since: float | None = None
        self._patience = _DOWN_AFTER_S
        self._went_down = -_DOWN_MOST_S

    @property
    def rung(self) -> ShedLevel:
        """What is left out now."""
        return self._rungs[self.level]

    def measured(self, lag: float, now: float) -> None:
        """Take in by how many seconds tracking is behind the pulses, at a time in seconds that only grows."""
        if lag > self._bounds.behind_s:
            self._abreast_since = None
            self._behind(lag, now)
            return
        self._behind_since = None
        if lag > self._bounds.abreast_s:
            self._abreast_since = None
        elif self._abreast_since is None:
            self._abreast_since = now
        elif now - self._abreast_since >= self._patience and self.level:
            self.level -= 1
            self._patience = max(self._patience / 2.0, _DOWN_AFTER_S)
            self._went_down, self._abreast_since = now, now

    def _behind(self, lag: float, now: float) -> None:
        if self._behind_since is None:
            self._behind_since, self._behind_by = now, lag
        elif now - self._behind_since >= _UP_AFTER_S:
            if lag > _CATCHES_UP * self._behind_by:
                self._up(now)
            self._behind_since, self._behind_by = now, lag

    def _up(self, now: float) -> None:
        if self.level == len(self._rungs) - 1:
            return
        self.level += 1
        if now - self._went_down < _DOWN_MOST_S:
            self._patience = min(_TOO_SOON * self._patience, _DOWN_MOST_S)
