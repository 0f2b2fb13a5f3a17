"""Rate limit of wrong tokens, by address: several at once, then one every few seconds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

_BURST = 5
"""Wrong tokens that one address may send before it has to wait."""
_FORGIVEN_S = 12.0
"""Seconds after which one of them is forgotten."""
_ADDRESSES = 1024


@dataclass(slots=True)
class LoginRateLimit:
    """A leaky bucket of wrong tokens for each address; ``now`` is a clock in seconds that never steps."""

    now: Callable[[], float]
    _until: dict[str, float] = field(default_factory=dict)
    """When all of an address's failures are forgotten."""

    def wait(self, address: str) -> float:
        """Return the seconds that an address has to wait before its next try; 0: none."""
        return max(0.0, self._until.get(address, 0.0) - self.now() - (_BURST - 1) * _FORGIVEN_S)

    def add(self, address: str) -> None:
        """Count a wrong token."""
        now = self.now()
        self._until = {it: until for it, until in self._until.items() if until > now}
        if len(self._until) >= _ADDRESSES:
            del self._until[min(self._until, key=self._until.__getitem__)]
        self._until[address] = max(now, self._until.get(address, 0.0)) + _FORGIVEN_S
