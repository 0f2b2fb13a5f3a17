"""Flags: one for the same people, few and the most urgent, seen through to their end."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.config.sections import FlagSettings
from server.service.operator_assist.flags import Flag, FlagQueue, RiskEvent

FPS = 25.0
STRIDE = 5


def foreseen(*objects: int, pulse: int, camera: str = "c0", risk: float = 0.5) -> RiskEvent:
    return RiskEvent(camera, objects, "crossing", pulse, margin=0.5, risk=risk)


class Asked:
    """Flags, and what was told of them."""

    def __init__(self, per_minute: int = 2, answer_s: float = 2.0) -> None:
        self.flags = FlagQueue(FlagSettings(per_minute=per_minute, answer_s=answer_s), FPS)
        self.told: list[Flag] = []
        self.flags.on_flag.append(self.told.append)
        self.merged: dict[int, int] = {}

    def step(self, now: int, *troubles: RiskEvent) -> None:
        self.flags.step(now, troubles, lambda number: self.merged.get(number, number))

    @property
    def states(self) -> list[tuple[int, str]]:
        return [(flag.id, flag.state) for flag in self.told]


def test_what_is_foreseen_again_and_by_others_is_one_flag() -> None:
    asked = Asked()
    asked.step(10, foreseen(7, 9, pulse=40))
    asked.step(15, foreseen(7, 9, pulse=41))
    asked.step(20, foreseen(9, 7, pulse=39, camera="c1"))
    [flag] = asked.flags.open
    assert (flag.objects, flag.cameras, flag.state) == ([7, 9], ["c0", "c1"], "raised")
    assert [it.cameras for it in asked.told] == [["c0"], ["c0", "c1"]], "a frame's difference is not told"
    assert asked.flags.counts["raised"] == 1


def test_of_too_many_the_riskiest_are_raised() -> None:
    asked = Asked(per_minute=2)
    asked.step(
        10, foreseen(1, 2, pulse=30), foreseen(3, 4, pulse=40, risk=0.9), foreseen(5, 6, pulse=60, risk=0.6)
    )
    assert [flag.objects for flag in asked.flags.open] == [[3, 4], [5, 6]]
    asked.step(700, foreseen(1, 2, pulse=710, risk=0.95))
    assert [flag.objects for flag in asked.flags.open] == [], "there is one each half a minute"
    asked.step(10 + 30 * 25, foreseen(1, 2, pulse=780, risk=0.95))
    assert [flag.objects for flag in asked.flags.open] == [[1, 2]]


def test_what_nobody_is_to_be_asked_about_is_not_raised() -> None:
    flags = FlagQueue(FlagSettings(reasons=["id_switch"]), FPS)
    flags.step(10, [foreseen(7, 9, pulse=40)], int)
    assert flags.open == []
    flags.step(15, [RiskEvent("c0", (7, 9), "id_switch", 40, 0.5, 0.5)], int)
    assert [flag.reason for flag in flags.open] == ["id_switch"]


def test_a_flag_that_is_followed_through_is_answered_at_once() -> None:
    asked = Asked()
    asked.step(10, foreseen(7, 9, pulse=40))
    assert asked.flags.pointed(9, "c0", [30, 31]) == [1]
    assert asked.flags.pointed(9, "c0", [40, 41]) == [1]
    assert asked.flags.pointed(9, "c1", [60]) == [], "which has not asked"
    assert asked.flags.open[0].state == "followed"
    assert asked.flags.pointed(9, "c0", [49, 50]) == [1]
    assert asked.states == [(1, "raised"), (1, "followed"), (1, "answered")]
    assert asked.flags.pointed(9, "c0", [51]) == []
    assert asked.flags.open == []
    assert [flag.state for flag in asked.flags.ended] == ["answered"]


@pytest.mark.parametrize(
    ("pointed", "ends"), [([], "expired"), ([39], "expired"), ([41], "answered")], ids=str
)
def test_what_nobody_sees_through_expires(pointed: Sequence[int], ends: str) -> None:
    asked = Asked(answer_s=2.0)
    asked.step(10, foreseen(7, 9, pulse=40))
    if pointed:
        asked.flags.pointed(7, "c0", pointed)
    asked.step(90)
    assert len(asked.flags.open) == 1
    asked.step(91)
    assert asked.states[-1] == (1, ends)
    assert asked.flags.counts[ends] == 1


def test_what_was_just_answered_is_not_asked_again() -> None:
    asked = Asked(per_minute=10, answer_s=2.0)
    asked.step(10, foreseen(7, 9, pulse=40))
    asked.flags.pointed(7, "c0", [60])
    asked.step(45, foreseen(7, 9, pulse=44))
    assert asked.flags.open == []
    asked.step(115, foreseen(7, 9, pulse=130))
    assert [flag.id for flag in asked.flags.open] == [2], "another meeting of the same two"


def test_who_turns_out_to_be_somebody_else_is_asked_about_by_their_number() -> None:
    asked = Asked()
    asked.step(10, foreseen(7, 9, pulse=40))
    asked.merged = {9: 4}
    asked.step(15, foreseen(4, 7, pulse=40))
    assert [flag.objects for flag in asked.flags.open] == [[7, 4]]
    assert asked.flags.counts["raised"] == 1
    assert asked.flags.pointed(4, "c0", [50]) == [1]


@given(
    st.lists(
        st.tuples(
            st.integers(0, 3), st.lists(st.tuples(st.integers(1, 3), st.integers(4, 6), st.integers(-20, 60)))
        ),
        max_size=60,
    )
)
def test_whatever_comes_flags_are_few_and_each_ends_once(
    steps: list[tuple[int, list[tuple[int, int, int]]]],
) -> None:
    asked, now, raised = Asked(per_minute=3, answer_s=1.0), 0, []
    for pause, troubles in steps:
        now += STRIDE * (1 + 40 * pause)
        before = asked.flags.counts["raised"]
        asked.step(now, *(foreseen(one, two, pulse=max(0, now + it)) for one, two, it in troubles))
        raised += [now] * (asked.flags.counts["raised"] - before)
        assert sum(it > now - 60 * FPS for it in raised) <= 3 * (1 + 3)
        people = [tuple(flag.objects) for flag in asked.flags.open]
        assert len(people) == len(set(people))
    asked.step(now + 10_000)
    assert asked.flags.open == []
    ends = [flag.id for flag in asked.told if flag.over]
    assert sorted(ends) == list(range(1, asked.flags.counts["raised"] + 1))
    assert asked.flags.counts["answered"] + asked.flags.counts["expired"] == asked.flags.counts["raised"]
