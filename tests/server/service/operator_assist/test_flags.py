"""The flag queue: one flag for the same people, few and the most urgent, until answered or expired."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.config.sections import FlagSettings
from server.service.operator_assist.flags import Flag, FlagQueue, PersonRisk

FPS = 25.0
STRIDE = 5


def risk_event(*objects: int, pulse: int, camera: str = "c0", risk: float = 0.5) -> PersonRisk:
    return PersonRisk(camera, objects, "crossing", pulse, margin=0.5, risk=risk)


class FlagRecorder:
    """A flag queue and its published flags."""

    def __init__(self, per_minute: int = 2, answer_s: float = 2.0) -> None:
        self.flags = FlagQueue(FlagSettings(per_minute=per_minute, answer_s=answer_s), FPS)
        self.published: list[Flag] = []
        self.flags.on_flag.append(self.published.append)
        self.merged: dict[int, int] = {}

    def step(self, now: int, *events: PersonRisk) -> None:
        self.flags.step(now, events, lambda number: self.merged.get(number, number))

    @property
    def states(self) -> list[tuple[int, str]]:
        return [(flag.id, flag.state) for flag in self.published]


def test_repeated_events_of_several_cameras_are_one_flag() -> None:
    recorder = FlagRecorder()
    recorder.step(10, risk_event(7, 9, pulse=40))
    recorder.step(15, risk_event(7, 9, pulse=41))
    recorder.step(20, risk_event(9, 7, pulse=39, camera="c1"))
    [flag] = recorder.flags.open
    assert (flag.objects, flag.cameras, flag.state) == ([7, 9], ["c0", "c1"], "raised")
    assert [flag.cameras for flag in recorder.published] == [["c0"], ["c0", "c1"]], (
        "a shift by one frame is not published"
    )
    assert recorder.flags.counts["raised"] == 1


def test_of_too_many_events_the_riskiest_are_flagged() -> None:
    recorder = FlagRecorder(per_minute=2)
    recorder.step(
        10,
        risk_event(1, 2, pulse=30),
        risk_event(3, 4, pulse=40, risk=0.9),
        risk_event(5, 6, pulse=60, risk=0.6),
    )
    assert [flag.objects for flag in recorder.flags.open] == [[3, 4], [5, 6]]
    recorder.step(700, risk_event(1, 2, pulse=710, risk=0.95))
    assert [flag.objects for flag in recorder.flags.open] == [], "one every half minute"
    recorder.step(10 + 30 * 25, risk_event(1, 2, pulse=780, risk=0.95))
    assert [flag.objects for flag in recorder.flags.open] == [[1, 2]]


def test_events_of_other_reasons_are_not_flagged() -> None:
    flags = FlagQueue(FlagSettings(reasons=["id_switch"]), FPS)
    flags.step(10, [risk_event(7, 9, pulse=40)], int)
    assert flags.open == []
    flags.step(15, [PersonRisk("c0", (7, 9), "id_switch", 40, 0.5, 0.5)], int)
    assert [flag.reason for flag in flags.open] == ["id_switch"]


def test_a_flag_is_answered_once_the_failure_has_passed() -> None:
    recorder = FlagRecorder()
    recorder.step(10, risk_event(7, 9, pulse=40))
    assert recorder.flags.record_pointing(9, "c0", [30, 31]) == [1]
    assert recorder.flags.record_pointing(9, "c0", [40, 41]) == [1]
    assert recorder.flags.record_pointing(9, "c1", [60]) == [], "not a camera of the flag"
    assert recorder.flags.open[0].state == "followed"
    assert recorder.flags.record_pointing(9, "c0", [49, 50]) == [1]
    assert recorder.states == [(1, "raised"), (1, "followed"), (1, "answered")]
    assert recorder.flags.record_pointing(9, "c0", [51]) == []
    assert recorder.flags.open == []
    assert [flag.state for flag in recorder.flags.ended] == ["answered"]


@pytest.mark.parametrize(
    ("pointed", "ends"), [([], "expired"), ([39], "expired"), ([41], "answered")], ids=str
)
def test_a_flag_not_pointed_at_to_the_end_expires(pointed: Sequence[int], ends: str) -> None:
    recorder = FlagRecorder(answer_s=2.0)
    recorder.step(10, risk_event(7, 9, pulse=40))
    if pointed:
        recorder.flags.record_pointing(7, "c0", pointed)
    recorder.step(90)
    assert len(recorder.flags.open) == 1
    recorder.step(91)
    assert recorder.states[-1] == (1, ends)
    assert recorder.flags.counts[ends] == 1


def test_an_answered_failure_is_not_flagged_again() -> None:
    recorder = FlagRecorder(per_minute=10, answer_s=2.0)
    recorder.step(10, risk_event(7, 9, pulse=40))
    recorder.flags.record_pointing(7, "c0", [60])
    recorder.step(45, risk_event(7, 9, pulse=44))
    assert recorder.flags.open == []
    recorder.step(115, risk_event(7, 9, pulse=130))
    assert [flag.id for flag in recorder.flags.open] == [2], "another meeting of the same two"


def test_flags_use_the_current_numbers_of_merged_people() -> None:
    recorder = FlagRecorder()
    recorder.step(10, risk_event(7, 9, pulse=40))
    recorder.merged = {9: 4}
    recorder.step(15, risk_event(4, 7, pulse=40))
    assert [flag.objects for flag in recorder.flags.open] == [[7, 4]]
    assert recorder.flags.counts["raised"] == 1
    assert recorder.flags.record_pointing(4, "c0", [50]) == [1]


@given(
    st.lists(
        st.tuples(
            st.integers(0, 3), st.lists(st.tuples(st.integers(1, 3), st.integers(4, 6), st.integers(-20, 60)))
        ),
        max_size=60,
    )
)
def test_flags_are_limited_and_each_ends_once(
    steps: list[tuple[int, list[tuple[int, int, int]]]],
) -> None:
    recorder, now, raised = FlagRecorder(per_minute=3, answer_s=1.0), 0, []
    for pause, events in steps:
        now += STRIDE * (1 + 40 * pause)
        before = recorder.flags.counts["raised"]
        recorder.step(now, *(risk_event(one, two, pulse=max(0, now + offset)) for one, two, offset in events))
        raised += [now] * (recorder.flags.counts["raised"] - before)
        assert sum(pulse > now - 60 * FPS for pulse in raised) <= 3 * (1 + 3)
        people = [tuple(flag.objects) for flag in recorder.flags.open]
        assert len(people) == len(set(people))
    recorder.step(now + 10_000)
    assert recorder.flags.open == []
    ends = [flag.id for flag in recorder.published if flag.over]
    assert sorted(ends) == list(range(1, recorder.flags.counts["raised"] + 1))
    assert (
        recorder.flags.counts["answered"] + recorder.flags.counts["expired"]
        == recorder.flags.counts["raised"]
    )
