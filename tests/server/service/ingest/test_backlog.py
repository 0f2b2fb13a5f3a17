"""When what waits to be decided is left out: too far behind, for a while, and no nearer."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from server.service.ingest.backlog import BacklogMonitor

REACH = 100  # pulses


def lost(behind: Sequence[int], every_s: float = 1.0) -> list[bool]:
    """Return what is said to so many pulses behind, second by second."""
    times = iter(number * every_s for number in range(len(behind)))
    keeping_up = BacklogMonitor(REACH, lambda: next(times))
    return [keeping_up.is_lost(epochs_behind) for epochs_behind in behind]


@pytest.mark.parametrize(
    "behind",
    [
        [0, REACH] * 10,
        [1500 - 100 * number for number in range(14)],  # it was stopped, and makes up for it
        [REACH + 1] * 2,  # it may, by then
        [REACH + 1, REACH + 1, REACH] * 5,
    ],
    ids=["in time", "catching up", "not for long", "now and then"],
)
def test_nothing_is_skipped_while_decisions_keep_up_or_catch_up(behind: list[int]) -> None:
    assert not any(lost(behind))


@pytest.mark.parametrize("more", [0, 5, 25])
def test_a_backlog_that_does_not_shrink_is_skipped_and_then_has_time_again(more: int) -> None:
    behind = [REACH + 1 + more * number for number in range(3)]
    assert lost(behind + behind) == [False, False, True] * 2
