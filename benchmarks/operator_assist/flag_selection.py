"""Selection of the risk events that become flags, by a site's own flag budget."""

from __future__ import annotations

from collections.abc import Sequence

from server.config.sections import FlagSettings
from server.service.operator_assist.flag_budget import FlagBudget
from tracking.interactive import RiskEvent

_MOST = 1000
"""Largest track id in a clip."""


class FlagSelector:
    """Selects flags by the budget; the clips follow each other as if they were one recording."""

    def __init__(self, settings: FlagSettings, fps: float) -> None:
        self._budget = FlagBudget(settings, fps)
        self._same = settings.answer_s * fps
        self._began = self._last = 0
        self._raised: dict[frozenset[int], int] = {}

    def begin(self) -> None:
        """Begin another clip, with other tracks."""
        self._began = self._last = self._last + 1
        self._raised = {}

    def raised(self, newest: int, risk_events: Sequence[RiskEvent]) -> list[RiskEvent]:
        """Return the risk events of a window that raise flags, the riskiest first."""
        now = self._last = self._began + newest
        whose = [
            frozenset(self._began * _MOST + local_id for local_id in event.objects) for event in risk_events
        ]
        for who, it in zip(whose, risk_events, strict=True):
            self._budget.record_risk(now, who, it.risk)
        found = []
        for who, it in sorted(zip(whose, risk_events, strict=True), key=lambda event: -event[1].risk):
            if now - self._raised.get(who, -(10**9)) > self._same and self._budget.is_worth_flag(
                now, who, it.risk
            ):
                self._budget.record_flag(now, who)
                self._raised[who] = now
                found.append(it)
        return found
