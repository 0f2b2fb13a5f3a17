"""A throttle logs the first of repeated events, few of those that follow, and the end."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from logthrottle import EndedEvents, LogThrottle

MINUTE, HOUR = 60.0, 3600.0


class ManualClock:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def logged_at(
    throttle: LogThrottle, clock: ManualClock, *, until: float, every: float, reason: str = ""
) -> list[float]:
    """Record an event every ``every`` seconds; return the times of the logged ones."""
    times = []
    while clock.now < until:
        if throttle.record(reason) is not None:
            times.append(clock.now)
        clock.now += every
    return times


def test_the_first_event_is_logged_and_then_one_after_pauses_that_double_up_to_an_hour() -> None:
    clock = ManualClock()
    times = logged_at(LogThrottle(clock), clock, until=4 * HOUR, every=10.0)
    assert [moment / MINUTE for moment in times] == [0, 1, 3, 7, 15, 31, 63, 123, 183]


def test_a_line_states_how_many_events_were_not_logged_before_it() -> None:
    clock = ManualClock()
    throttle = LogThrottle(clock)
    assert throttle.record() == ""
    clock.now = 1.0
    assert [throttle.record() for _ in range(3)] == [None] * 3
    clock.now = 60.0
    assert throttle.record() == ", and 3 times before"


def test_a_new_reason_is_logged_at_once_unless_every_event_has_a_new_one() -> None:
    throttle = LogThrottle(ManualClock())
    reasons = ["closed", "refused", "refused", "closed", "no route"]
    assert [throttle.record(reason) is not None for reason in reasons] == [True, True, False, False, True]
    assert sum(throttle.record(f"byte {number}") is not None for number in range(1000)) < 10


def test_after_a_quiet_minute_events_count_as_new() -> None:
    clock = ManualClock()
    throttle = LogThrottle(clock)
    logged_at(throttle, clock, until=HOUR, every=10.0, reason="closed")
    clock.now += MINUTE
    again = clock.now
    assert logged_at(throttle, clock, until=again + 100.0, every=10.0, reason="closed") == [
        again,
        again + 60.0,
    ]


def test_a_series_ends_once_and_only_after_its_quiet_time() -> None:
    clock = ManualClock()
    throttle = LogThrottle(clock, quiet_s=20.0)
    assert throttle.end() is None, "no event yet"
    throttle.record()
    clock.now = 5.0
    throttle.record()
    clock.now = 24.0
    assert throttle.end() is None, "it may continue"
    clock.now = 25.0
    assert throttle.end() == EndedEvents(count=2, seconds=5.0)
    assert throttle.end() is None


def test_the_end_is_logged_only_where_the_beginning_was() -> None:
    clock = ManualClock()
    throttle = LogThrottle(clock, quiet_s=0.0)
    lines: list[str | EndedEvents] = []
    while clock.now < HOUR:
        if (more := throttle.record()) is not None:
            lines.append(more)
        clock.now += 0.5
        if ended := throttle.end():
            lines.append(ended)
        clock.now += 0.5
    assert len(lines) == 2 * 6
    assert lines[:4] == ["", EndedEvents(1, 0.5), ", and 59 times before", EndedEvents(1, 0.5)]


def test_a_series_lasts_until_the_first_success() -> None:
    clock = ManualClock()
    throttle = LogThrottle(clock, quiet_s=0.0)
    logged_at(throttle, clock, until=HOUR, every=10.0)
    assert throttle.end() == EndedEvents(360, HOUR)


@given(st.lists(st.tuples(st.floats(0.0, 100.0), st.booleans()), max_size=200))
def test_every_event_is_counted(steps: list[tuple[float, bool]]) -> None:
    clock = ManualClock()
    throttle = LogThrottle(clock, quiet_s=0.0)
    events = counted = 0
    for wait, succeeded in steps:
        clock.now += wait
        if succeeded:
            throttle.end()
            continue
        events += 1
        more = throttle.record()
        if more is not None:
            counted += 1 + _unlogged(more)
            assert counted == events


def _unlogged(more: str) -> int:
    """Parse from a line how many events were not logged before it."""
    number = more.removeprefix(", and ").removesuffix(" before").removesuffix(" times")
    return {"": 0, "once": 1}.get(number) or int(number or 0)
