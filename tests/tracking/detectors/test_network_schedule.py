"""When the fused detector's network runs: by frame numbers, in seconds, earlier where it is needed."""

from __future__ import annotations

import pytest

from tracking.detectors.fused.schedule import NetworkSchedule


def runs(schedule: NetworkSchedule, frames: range, *, needed: bool = False) -> list[int]:
    return [frame for frame in frames if schedule.is_due(frame, needed=needed)]


@pytest.mark.parametrize(("fps", "every"), [(60.0, 12), (25.0, 5), (12.5, 2), (5.0, 1), (2.0, 1)])
def test_the_interval_is_in_seconds(fps: float, every: int) -> None:
    assert runs(NetworkSchedule(0.2, fps), range(60)) == list(range(0, 60, every))


def test_a_network_in_need_runs_earlier_but_not_for_long() -> None:
    seconds = 60
    schedule = NetworkSchedule(0.2, 25.0)
    frames = runs(schedule, range(25 * seconds), needed=True)
    assert frames[:5] == [0, 2, 5, 7, 10]
    regular = 5 * seconds
    assert regular < len(frames) <= regular + seconds + 3


def test_after_a_gap_the_network_runs_at_once() -> None:
    schedule = NetworkSchedule(0.2, 25.0)
    assert runs(schedule, range(3)) == [0]
    assert runs(schedule, range(17, 22)) == [17, 20]


def test_a_schedule_that_begins_later_has_the_same_runs() -> None:
    early, late = NetworkSchedule(0.2, 25.0), NetworkSchedule(0.2, 25.0)
    assert set(runs(late, range(43, 100))) - {43} == set(runs(early, range(100))) & set(range(44, 100))


@pytest.mark.parametrize("interval_s", [0.0, 0.2])
def test_a_stretched_schedule_runs_in_one_of_so_many_intervals_until_it_is_as_before(
    interval_s: float,
) -> None:
    schedule = NetworkSchedule(interval_s, 25.0)
    every = schedule.every
    schedule.stretch(4)
    assert runs(schedule, range(80)) == list(range(0, 80, 4 * every))
    schedule.stretch(1)
    assert runs(schedule, range(80, 100)) == list(range(80, 100, every))
