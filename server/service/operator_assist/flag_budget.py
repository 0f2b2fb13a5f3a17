"""The budget of flags per minute: which risk events are worth a flag."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from server.config.sections import FlagSettings

_MINUTE_S = 60.0
_HISTORY_S = 600.0
"""Seconds of past risk events that a new one is compared with."""
_COOLDOWN_S = 4.0
"""Seconds in which a person has at most one flag."""
_SAVED_MINUTES = 3.0
"""Minutes for which unused flags are saved."""
_SAME_S = 8.0
"""Risk events of the same people within so many seconds are one risk."""


@dataclass(slots=True)
class _RecentRisk:
    """A risk of some people: when it was last reported, and its highest value."""

    pulse: int
    risk: float


class FlagBudget:
    """Spends a limited number of flags on the likeliest failures. It has no clock: callers pass the pulse.

    A risk grows over time: a higher threshold (``risk`` of the settings) avoids false flags, but raises flags
    later. If more risks pass the threshold than may be flagged, one is worth a flag if it is
    among the ``per_minute`` times T highest of the last T minutes. Failures come in bursts, so unused flags
    are saved for three minutes. One failure may be reported with several people, since a lost person is
    similar to everyone nearby: for some seconds no person has two flags.
    """

    def __init__(self, settings: FlagSettings, fps: float) -> None:
        self._per_minute, self._min_risk, self._fps = settings.per_minute, settings.risk, fps
        self._first: int | None = None
        self._risks: dict[frozenset[int], _RecentRisk] = {}
        self._history: list[_RecentRisk] = []
        self._left = float(settings.per_minute)
        """Flags that may be raised now."""
        self._raised: deque[tuple[int, frozenset[int]]] = deque()
        self._last: int | None = None

    def record_risk(self, now: int, people: frozenset[int], risk: float) -> None:
        """Record a risk of these people, whether or not it is worth a flag."""
        self._advance(now)
        current = self._risks.get(people)
        if current is None:
            current = self._risks[people] = _RecentRisk(now, risk)
            self._history.append(current)
        current.pulse, current.risk = now, max(current.risk, risk)

    def is_worth_flag(self, now: int, people: frozenset[int], risk: float) -> bool:
        """Return whether a risk of these people is worth a flag now."""
        self._advance(now)
        if any(people & flagged for _, flagged in self._raised):
            return False
        if self._left < 1.0 or risk < self._min_risk:
            return False
        history = min(now - self._first if self._first is not None else 0, _HISTORY_S * self._fps)
        minutes = max(history / (_MINUTE_S * self._fps), 1.0)
        return sum(recorded.risk > risk for recorded in self._history) < self._per_minute * minutes

    def record_flag(self, now: int, people: frozenset[int]) -> None:
        """Record that a flag is raised."""
        self._left -= 1.0
        self._raised.append((now, people))

    def _advance(self, now: int) -> None:
        """Advance to a pulse: add to the budget, and drop expired risks and flags."""
        self._first = now if self._first is None else self._first
        while self._raised and self._raised[0][0] < now - _COOLDOWN_S * self._fps:
            self._raised.popleft()
        if now == self._last:
            return
        passed = (now - (now if self._last is None else self._last)) / (_MINUTE_S * self._fps)
        self._left = min(self._left + self._per_minute * passed, self._per_minute * _SAVED_MINUTES)
        self._last = now
        for people in [
            people for people, risk in self._risks.items() if risk.pulse < now - _SAME_S * self._fps
        ]:
            del self._risks[people]
        # Not in order of expiry: an ongoing risk is reported again and again.
        self._history = [
            earlier for earlier in self._history if earlier.pulse >= now - _HISTORY_S * self._fps
        ]
