"""Exponential backoff: delays between repeated attempts."""

from __future__ import annotations

from tenacity import RetryCallState, Retrying, wait_exponential

__all__ = ["Backoff"]


class Backoff:
    """Delays that double from ``first_s`` to ``max_s`` seconds, one per consecutive failure."""

    def __init__(self, first_s: float, max_s: float) -> None:
        self._wait = wait_exponential(multiplier=first_s, max=max_s)
        self._attempts = RetryCallState(Retrying(), None, (), {})
        self.reset()

    @property
    def failures(self) -> int:
        """Consecutive failures: the calls of :meth:`next` since the last :meth:`reset`."""
        return self._attempts.attempt_number

    def next(self) -> float:
        """Return the seconds to wait before the next attempt."""
        self._attempts.attempt_number += 1
        return self._wait(self._attempts)

    def reset(self) -> None:
        """Start with ``first_s`` again, after a successful attempt."""
        self._attempts.attempt_number = 0
