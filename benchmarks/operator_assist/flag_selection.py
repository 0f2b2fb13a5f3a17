"""Which troubles become flags, clip after clip: as many a minute as a site raises, where it raises them."""

from __future__ import annotations

from collections.abc import Sequence

from server.config.sections import FlagSettings
from server.service.operator_assist.flag_budget import FlagBudget
from tracking.interactive import RiskEvent

_MOST = 1000
"""Numbers that people of one clip have at most."""


class FlagSelector:
    """Raises flags. The clips follow each other as if they were one recording."""

    def __init__(self, settings: FlagSettings, fps: float) -> None:
        self._budget = FlagBudget(settings, fps)
        self._same = settings.answer_s * fps
        self._began = self._last = 0
        self._raised: dict[frozenset[int], int] = {}

    def begin(self) -> None:
        """Begin another clip, in which people have other numbers."""
        self._began = self._last = self._last + 1
        self._raised = {}

    def raised(self, newest: int, troubles: Sequence[RiskEvent]) -> list[RiskEvent]:
        """Return those of a window's troubles for which a flag is raised, the riskiest first."""
        now = self._last = self._began + newest
        whose = [frozenset(self._began * _MOST + it for it in trouble.objects) for trouble in troubles]
        for who, it in zip(whose, troubles, strict=True):
            self._budget.record_risk(now, who, it.risk)
        found = []
        for who, it in sorted(zip(whose, troubles, strict=True), key=lambda it: -it[1].risk):
            if now - self._raised.get(who, -(10**9)) > self._same and self._budget.is_worth_flag(
                now, who, it.risk
            ):
                self._budget.record_flag(now, who)
                self._raised[who] = now
                found.append(it)
        return found
