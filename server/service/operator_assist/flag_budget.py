"""The budget of flags per minute: which risk events are worth a flag."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from server.config.sections import FlagSettings

_MINUTE_S = 60.0
_LOOKS_BACK_S = 600.0
"""Seconds of what was foreseen that say how likely a failure must be to be among the likeliest."""
_ONE_S = 4.0
"""Seconds for which whom a flag is about are asked about once."""
_SAVED_MINUTES = 3.0
_SAME_S = 8.0
"""Seconds within which the same people are the same trouble."""


@dataclass(slots=True)
class _RecentRisk:
    """One trouble: when it was told last, and the highest risk that it had."""

    pulse: int
    risk: float


class FlagBudget:
    """Spends few flags on what is likeliest to fail. It has no clock: it is told which pulse it is.

    A risk grows while a trouble lasts: who waits for it to be as high as ``risk`` of the settings asks
    about fewer that come to nothing, and who waits longer may wait in vain. Where more are as risky than may
    be flagged, a trouble is worth a flag if it is among the ``per_minute`` times T riskiest of the last T
    minutes: had a flag been raised for all that were as risky, no more would have been raised than may be.
    Troubles come in bursts: flags that were not raised are saved, for three minutes. And one trouble has
    several names, since who is lost is alike to everybody near: for some seconds nobody has two flags.
    """

    def __init__(self, settings: FlagSettings, fps: float) -> None:
        self._per_minute, self._least, self._fps = settings.per_minute, settings.risk, fps
        self._first: int | None = None
        self._told: dict[frozenset[int], _RecentRisk] = {}
        self._before: list[_RecentRisk] = []
        self._left = float(settings.per_minute)
        """Flags that may be raised now."""
        self._raised: deque[tuple[int, frozenset[int]]] = deque()
        self._last: int | None = None

    def hear(self, now: int, who: frozenset[int], risk: float) -> None:
        """Take down a trouble of these people, whether it is worth a flag or not."""
        self._go_on(now)
        known = self._told.get(who)
        if known is None:
            known = self._told[who] = _RecentRisk(now, risk)
            self._before.append(known)
        known.pulse, known.risk = now, max(known.risk, risk)

    def worth(self, now: int, who: frozenset[int], risk: float) -> bool:
        """Return whether a risk event of these persons is worth a flag now."""
        self._go_on(now)
        if any(who & others for _, others in self._raised):
            return False
        if self._left < 1.0 or risk < self._least:
            return False
        span = min(now - self._first if self._first is not None else 0, _LOOKS_BACK_S * self._fps)
        minutes = max(span / (_MINUTE_S * self._fps), 1.0)
        return sum(it.risk > risk for it in self._before) < self._per_minute * minutes

    def spend(self, now: int, who: frozenset[int]) -> None:
        """Note that a flag is raised."""
        self._left -= 1.0
        self._raised.append((now, who))

    def _go_on(self, now: int) -> None:
        """Let time pass: what may be spent grows, and what is long ago is forgotten."""
        self._first = now if self._first is None else self._first
        while self._raised and self._raised[0][0] < now - _ONE_S * self._fps:
            self._raised.popleft()
        if now == self._last:
            return
        passed = (now - (now if self._last is None else self._last)) / (_MINUTE_S * self._fps)
        self._left = min(self._left + self._per_minute * passed, self._per_minute * _SAVED_MINUTES)
        self._last = now
        for who in [it for it, told in self._told.items() if told.pulse < now - _SAME_S * self._fps]:
            del self._told[who]
        # What lasts is told again and again: who began first need not be the first to be over.
        self._before = [it for it in self._before if it.pulse >= now - _LOOKS_BACK_S * self._fps]
