"""Rate limit for wrong tokens per address, at sign-in and elsewhere: a burst, then one every few seconds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

_BURST = 5
"""Wrong tokens that an address may send before it has to wait."""
_FORGIVE_AFTER_S = 12.0
"""Seconds after which one wrong token is forgiven."""
_ADDRESSES = 1024


@dataclass(slots=True)
class WrongTokenRateLimit:
    """A leaky bucket of wrong tokens for each address; ``now`` is a monotonic clock in seconds."""

    now: Callable[[], float]
    _until: dict[str, float] = field(default_factory=dict)
    """By address, when all of its wrong tokens are forgiven."""

    def wait(self, address: str) -> float:
        """Return the seconds that an address has to wait before its next attempt."""
        return max(0.0, self._until.get(address, 0.0) - self.now() - (_BURST - 1) * _FORGIVE_AFTER_S)

    def add(self, address: str) -> None:
        """Count a wrong token."""
        now = self.now()
        self._until = {other: until for other, until in self._until.items() if until > now}
        if len(self._until) >= _ADDRESSES:
            del self._until[min(self._until, key=self._until.__getitem__)]
        self._until[address] = max(now, self._until.get(address, 0.0)) + _FORGIVE_AFTER_S
