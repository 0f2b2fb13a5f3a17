"""What happens again and again is told when it begins, seldom while it goes on, and when it is over."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from camsync import Ended, Spell

MINUTE, HOUR = 60.0, 3600.0


class Time:
    """A clock by hand."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def told(spell: Spell, clock: Time, *, until: float, every: float, why: str = "") -> list[float]:
    """Let it happen every so many seconds; give when it was told."""
    moments = []
    while clock.now < until:
        if spell.happened(why) is not None:
            moments.append(clock.now)
        clock.now += every
    return moments


def test_it_is_told_at_once_and_then_after_pauses_that_double_up_to_an_hour() -> None:
    clock = Time()
    moments = told(Spell(clock), clock, until=4 * HOUR, every=10.0)
    in_minutes = [it / MINUTE for it in moments]
    assert in_minutes == [0, 1, 3, 7, 15, 31, 63, 123, 183]


def test_whoever_is_told_of_it_again_is_told_how_often_it_was_since() -> None:
    clock = Time()
    spell = Spell(clock)
    assert spell.happened() == ""
    clock.now = 1.0
    assert [spell.happened() for _ in range(3)] == [None] * 3
    clock.now = 60.0
    assert spell.happened() == ", and 3 times before"


def test_another_reason_is_told_at_once_unless_each_time_has_another() -> None:
    clock = Time()
    spell = Spell(clock)
    whys = ["closed", "refused", "refused", "closed", "no route"]
    assert [spell.happened(it) is not None for it in whys] == [True, True, False, False, True]
    assert sum(spell.happened(f"byte {it}") is not None for it in range(1000)) < 10


def test_what_has_not_happened_for_a_minute_is_told_anew() -> None:
    clock = Time()
    spell = Spell(clock)
    told(spell, clock, until=HOUR, every=10.0, why="closed")
    clock.now += MINUTE
    again = clock.now
    assert told(spell, clock, until=again + 100.0, every=10.0, why="closed") == [again, again + 60.0]


def test_it_is_over_once_and_after_a_while_in_which_all_was_well() -> None:
    clock = Time()
    spell = Spell(clock, calm=20.0)
    assert spell.over() is None, "nothing has begun"
    spell.happened()
    clock.now = 5.0
    spell.happened()
    clock.now = 24.0
    assert spell.over() is None, "it may go on"
    clock.now = 25.0
    assert spell.over() == Ended(times=2, seconds=5.0)
    assert spell.over() is None


def test_what_comes_and_goes_is_told_of_as_seldom_and_its_end_only_where_its_beginning_was() -> None:
    clock = Time()
    spell = Spell(clock, calm=0.0)
    lines: list[str | Ended] = []
    while clock.now < HOUR:
        if (more := spell.happened()) is not None:
            lines.append(more)
        clock.now += 0.5
        if ended := spell.over():
            lines.append(ended)
        clock.now += 0.5
    assert len(lines) == 2 * 6
    assert lines[:4] == ["", Ended(1, 0.5), ", and 59 times before", Ended(1, 0.5)]


def test_how_long_it_lasted_is_counted_to_the_moment_at_which_all_is_well() -> None:
    clock = Time()
    spell = Spell(clock, calm=0.0)
    told(spell, clock, until=HOUR, every=10.0)
    assert spell.over() == Ended(360, HOUR)


@given(st.lists(st.tuples(st.floats(0.0, 100.0), st.booleans()), max_size=200))
def test_nothing_that_was_not_told_is_forgotten(steps: list[tuple[float, bool]]) -> None:
    clock = Time()
    spell = Spell(clock, calm=0.0)
    happened = counted = 0
    for wait, well in steps:
        clock.now += wait
        if well:
            spell.over()
            continue
        happened += 1
        more = spell.happened()
        if more is not None:
            counted += 1 + _before(more)
            assert counted == happened


def _before(more: str) -> int:
    """Read how often it was told to have happened before."""
    number = more.removeprefix(", and ").removesuffix(" before").removesuffix(" times")
    return {"": 0, "once": 1}.get(number) or int(number or 0)
