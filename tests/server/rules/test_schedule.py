"""Schedules apply at the days and hours of the site's time zone."""

from __future__ import annotations

from datetime import datetime, time
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.rules import Schedule

ZURICH = ZoneInfo("Europe/Zurich")
THURSDAY = datetime(2026, 11, 26, tzinfo=ZURICH)


def at(clock: str, day: int = 26) -> float:
    hour, minute = map(int, clock.split(":"))
    return THURSDAY.replace(day=day, hour=hour, minute=minute).timestamp()


@pytest.mark.parametrize(
    ("clock", "day", "expected"),
    [
        ("07:59", 26, False),
        ("08:00", 26, True),
        ("17:59", 26, True),
        ("18:00", 26, False),
        ("12:00", 27, False),
    ],
)
def test_hours_of_a_day_are_half_open(clock: str, day: int, expected: bool) -> None:
    schedule = Schedule(frozenset({"thu"}), time(8), time(18), ZURICH)
    assert schedule.includes(at(clock, day)) == expected


@pytest.mark.parametrize(
    ("clock", "day", "expected"),
    [
        ("21:59", 26, False),
        ("22:00", 26, True),
        ("05:59", 27, True),
        ("06:00", 27, False),
        ("05:00", 26, False),
    ],
)
def test_a_night_belongs_to_the_day_on_which_it_begins(clock: str, day: int, expected: bool) -> None:
    schedule = Schedule(frozenset({"thu"}), time(22), time(6), ZURICH)
    assert schedule.includes(at(clock, day)) == expected


def test_summer_time_shifts_the_hours() -> None:
    schedule = Schedule(begins=time(8), ends=time(9), zone=ZURICH)
    summer, winter = (datetime(2026, month, 1, 7, 30, tzinfo=ZoneInfo("UTC")) for month in (7, 12))
    assert not schedule.includes(summer.timestamp())
    assert schedule.includes(winter.timestamp())


@given(st.integers(1_600_000_000, 1_900_000_000), st.times(), st.times())
def test_a_span_and_the_span_from_its_end_to_its_beginning_divide_the_day(
    now: int, begins: time, ends: time
) -> None:
    inside = Schedule(begins=begins, ends=ends, zone=ZURICH).includes(now)
    outside = Schedule(begins=ends, ends=begins, zone=ZURICH).includes(now)
    assert inside != outside or (begins == ends and inside)
