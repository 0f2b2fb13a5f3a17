"""The arithmetic of pulses: no drift, no number twice, no number backwards."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camsync.clock import ClockOffset
from camsync.pulse_schedule import PulseCounter, PulseSchedule

rates = st.sampled_from([1.0, 12.5, 25.0, 30000 / 1001, 60.0, 500.0])
epochs = st.floats(1.7e9, 1.9e9)


@settings(deadline=None, max_examples=60)
@given(epochs, rates, st.integers(0, 10**9))
def test_a_pulse_is_the_one_due_at_its_due_time(epoch: float, fps: float, number: int) -> None:
    schedule = PulseSchedule(epoch, fps)
    assert schedule.due(number) == epoch + number / fps
    assert schedule.number_at(schedule.due(number)) == number


@settings(deadline=None, max_examples=60)
@given(epochs, rates, st.floats(-1e3, 1e7))
def test_the_number_now_is_due_and_the_next_is_not(epoch: float, fps: float, elapsed: float) -> None:
    schedule = PulseSchedule(epoch, fps)
    number = schedule.number_at(epoch + elapsed)
    assert schedule.due(number) <= epoch + elapsed < schedule.due(number + 1)


# A client's events: the number of a received pulse, or seconds without one.
events = st.lists(st.integers(0, 400) | st.floats(0.0, 3.0), max_size=40)


@settings(deadline=None, max_examples=60)
@given(rates, events)
def test_numbers_only_rise(fps: float, happened: list[int | float]) -> None:
    counter = PulseCounter(fps, catch_up=0.5)
    now = 1.7e9
    numbers: list[int] = []
    for event in happened:
        if isinstance(event, int):
            numbers += [number for number, _ in counter.fill_gap(event, now)]
            if counter.accept(event, now):
                numbers.append(event)
        else:
            now += event
            numbers += [number for number, _ in counter.count_local(now)]
    assert all(before < after for before, after in pairwise(numbers))


@settings(deadline=None, max_examples=60)
@given(rates, st.integers(0, 10**6), st.integers(1, 200))
def test_local_pulses_continue_at_the_rate_of_the_server(fps: float, number: int, more: int) -> None:
    counter = PulseCounter(fps, catch_up=1000.0)
    assert counter.accept(number, 1.8e9)
    generated = list(counter.count_local(1.8e9 + (more + 0.5) / fps))
    assert [number for number, _ in generated] == list(range(number + 1, number + more + 1))
    for i, (_, due) in enumerate(generated, start=1):
        assert due == pytest.approx(1.8e9 + i / fps, abs=1e-6)


def test_a_stalled_client_skips_to_the_current_pulse_instead_of_generating_hours_of_them() -> None:
    counter = PulseCounter(25.0, catch_up=0.5)
    counter.accept(10, 1000.0)
    assert [number for number, _ in counter.count_local(1000.0 + 3600.0)] == [10 + 3600 * 25]


@settings(deadline=None, max_examples=60)
@given(rates, st.integers(0, 10**6), st.integers(1, 300))
def test_a_short_gap_is_filled_and_a_long_one_is_not(fps: float, last: int, ahead: int) -> None:
    counter = PulseCounter(fps, catch_up=0.5)
    counter.accept(last, 1.8e9)
    number = last + ahead
    filled = list(counter.fill_gap(number, 1.8e9 + ahead / fps))
    assert counter.accept(number, 1.8e9 + ahead / fps)
    short = (ahead - 1) / fps <= 0.5
    assert [generated for generated, _ in filled] == (list(range(last + 1, number)) if short else [])
    assert all(due == pytest.approx(1.8e9 + (generated - last) / fps, abs=1e-6) for generated, due in filled)


def test_before_any_pulse_nothing_is_counted() -> None:
    counter = PulseCounter(25.0, catch_up=0.5)
    assert list(counter.count_local(1e9)) == []
    assert counter.known(1e9) is None
    assert counter.next_due() is None


def test_a_new_rate_applies_from_the_last_pulse_on() -> None:
    counter = PulseCounter(25.0, catch_up=10.0)
    counter.accept(100, 1000.0)
    counter.set_rate(50.0)
    assert counter.next_due() == pytest.approx(1000.02)


def test_the_sample_with_the_shortest_round_trip_gives_the_offset() -> None:
    clock = ClockOffset()
    assert clock.offset is None
    clock.greeted(server=105.2, received=100.0)
    assert clock.offset == pytest.approx(5.2)
    assert clock.round_trip is None
    clock.ponged(sent=100.0, server=105.4, received=100.4)  # 5.2, in 0.4
    clock.ponged(sent=101.0, server=106.01, received=101.02)  # 5.0, in 0.02
    clock.ponged(sent=102.0, server=107.6, received=102.6)
    assert clock.offset == pytest.approx(5.0)
    assert clock.round_trip == pytest.approx(0.02)
    clock.restart()
    assert clock.offset is None


@settings(deadline=None, max_examples=60)
@given(st.floats(-1e6, 1e6), st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=40))
def test_the_offset_is_wrong_by_at_most_half_the_shortest_round_trip(
    offset: float, delays: list[tuple[float, float]]
) -> None:
    clock = ClockOffset()
    for i, (there, back) in enumerate(delays):
        clock.ponged(sent=float(i), server=i + there + offset, received=i + there + back)
    shortest = min(there + back for there, back in delays[-16:])
    assert clock.offset is not None
    assert abs(clock.offset - offset) <= shortest / 2 + 1e-6


def test_an_answer_before_its_request_is_ignored() -> None:
    clock = ClockOffset()
    clock.ponged(sent=10.0, server=20.0, received=9.0)
    assert clock.offset is None
