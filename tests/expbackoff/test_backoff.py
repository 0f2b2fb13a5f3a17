"""Delays between attempts: doubled up to a limit, and short again after a success."""

from __future__ import annotations

from expbackoff import Backoff


def test_delays_double_up_to_the_limit_and_restart_after_a_success() -> None:
    backoff = Backoff(first_s=0.5, max_s=3.0)
    assert [backoff.next() for _ in range(5)] == [0.5, 1.0, 2.0, 3.0, 3.0]
    assert backoff.failures == 5
    backoff.reset()
    assert backoff.failures == 0
    assert backoff.next() == 0.5
