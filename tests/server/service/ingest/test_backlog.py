"""A backlog is skipped if it is too large for a while and does not shrink."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from server.service.ingest.backlog import BacklogMonitor

REACH = 100  # pulses


def skipped(behind: Sequence[int], every_s: float = 1.0) -> list[bool]:
    """Return for each measured backlog, in pulses, whether it is skipped."""
    times = iter(number * every_s for number in range(len(behind)))
    monitor = BacklogMonitor(REACH, lambda: next(times))
    return [monitor.is_lost(pulses_behind) for pulses_behind in behind]


@pytest.mark.parametrize(
    "behind",
    [
        [0, REACH] * 10,
        [1500 - 100 * number for number in range(14)],  # suspended, and catching up
        [REACH + 1] * 2,  # not for long enough
        [REACH + 1, REACH + 1, REACH] * 5,
    ],
    ids=["in time", "catching up", "not for long", "sometimes"],
)
def test_nothing_is_skipped_while_decisions_keep_up_or_catch_up(behind: list[int]) -> None:
    assert not any(skipped(behind))


@pytest.mark.parametrize("more", [0, 5, 25])
def test_a_backlog_that_does_not_shrink_is_skipped_after_three_measurements(more: int) -> None:
    behind = [REACH + 1 + more * number for number in range(3)]
    assert skipped(behind + behind) == [False, False, True] * 2
