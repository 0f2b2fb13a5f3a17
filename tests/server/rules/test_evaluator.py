"""Rules report steps over borders, stays, crowds and pairs once, and nobody flutters."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server.rules import (
    Area,
    Circumstances,
    Direction,
    Line,
    PeopleOfFrame,
    Phase,
    Rule,
    RuleEvaluator,
    RuleEvent,
    RuleKind,
)

CAMERA = frozenset({"c0"})
SEEN = Circumstances(moment=0.0, clear=CAMERA, usable=CAMERA)
TILL = Area("till", ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)), margin=0.5, hold=3, absent=10)
DOOR = Line("door", ((0.0, 0.0), (2.0, 0.0)), (1.0, 5.0), margin=0.5, hold=2, absent=10)
Point = tuple[float, float]


def rule(kind: str, zone: str | None = "till", **settings: Any) -> Rule:
    return Rule("r", RuleKind(kind), zone, **settings)


def frame(pulse: int, floor: Mapping[int, Point]) -> PeopleOfFrame:
    return PeopleOfFrame(pulse, floor, {}, dict.fromkeys(floor, CAMERA))


def run(
    rules: Iterable[Rule], frames: Sequence[Mapping[int, Point]], circumstances: Circumstances = SEEN
) -> list[RuleEvent]:
    evaluator = RuleEvaluator([TILL, DOOR], list(rules), absent=10)
    return [
        event
        for pulse, floor in enumerate(frames)
        for event in evaluator.step(frame(pulse, floor), circumstances)
    ]


def walk(*xs: float, y: float = 2.0, person: int = 1) -> list[dict[int, Point]]:
    return [{person: (x, y)} for x in xs]


def told(events: Iterable[RuleEvent]) -> list[tuple[str, str, int, tuple[int, ...]]]:
    return [(event.kind.value, event.phase.value, event.pulse, event.people) for event in events]


def test_entering_and_leaving_are_reported_once_with_the_frame_of_the_step() -> None:
    frames = walk(*[-2.0] * 5, *[1.0] * 10, *[-2.0] * 10)
    events = run([rule("entered"), rule("left")], frames)
    assert told(events) == [("entered", "once", 5, (1,)), ("left", "once", 15, (1,))]
    assert [event.confirmed for event in events] == [8, 18]


def test_a_step_that_does_not_last_is_none() -> None:
    assert run([rule("entered")], walk(*[-2.0] * 5, 1.0, 1.0, *[-2.0] * 5)) == []


def test_someone_outside_within_the_margin_has_not_left() -> None:
    assert told(run([rule("left")], walk(*[1.0] * 5, *[-0.4] * 10))) == []
    assert told(run([rule("left")], walk(*[1.0] * 5, *[-0.6] * 10))) == [("left", "once", 5, (1,))]


@settings(max_examples=50)
@given(st.lists(st.floats(-0.49, 0.49), min_size=1, max_size=200))
def test_nobody_flutters_at_the_border(jitter: list[float]) -> None:
    """Whatever happens within the margin, there is at most one entering and no leaving."""
    events = run([rule("entered"), rule("left")], walk(*jitter))
    assert [event.kind for event in events] in ([], [RuleKind.ENTERED])


@settings(max_examples=100)
@given(st.lists(st.sampled_from([-2.0, -0.3, 0.3, 2.0, None]), min_size=1, max_size=150))
def test_entering_and_leaving_alternate_and_are_apart(xs: list[float | None]) -> None:
    frames: list[dict[int, Point]] = [{} if x is None else {1: (x, 2.0)} for x in xs]
    events = run([rule("entered"), rule("left")], frames)
    kinds = [event.kind for event in events]
    assert kinds == [RuleKind.ENTERED, RuleKind.LEFT] * (len(kinds) // 2) + [RuleKind.ENTERED] * (
        len(kinds) % 2
    )
    assert all(
        after.confirmed - before.confirmed >= TILL.hold for before, after in itertools.pairwise(events)
    )
    assert all(event.pulse <= event.confirmed for event in events)


def test_who_is_not_seen_for_long_has_left_when_last_seen() -> None:
    frames = [*walk(*[1.0] * 6), *[{} for _ in range(9)]]
    assert run([rule("left")], frames) == []
    assert told(run([rule("left")], [*frames, {}])) == [("left", "once", 5, (1,))]


def test_where_the_camera_fails_nobody_leaves() -> None:
    evaluator = RuleEvaluator([TILL], [rule("left")], absent=10)
    for pulse, floor in enumerate(walk(*[1.0] * 6)):
        evaluator.step(frame(pulse, floor), SEEN)
    failed = Circumstances()
    assert all(not evaluator.step(frame(pulse, {}), failed) for pulse in range(6, 200))
    assert evaluator.people_in == {"till": [1]}
    assert all(not evaluator.step(frame(pulse, {}), SEEN) for pulse in range(200, 209))
    assert told(evaluator.step(frame(209, {}), SEEN)) == [("left", "once", 5, (1,))]


def test_a_line_is_crossed_in_a_direction() -> None:
    inward = [{1: (1.0, y)} for y in (-2, -1, 1, 2, 2, 2)]
    outward = [{1: (1.0, -y)} for y in (-2, -1, 1, 2, 2, 2)]
    for frames, direction in ((inward, Direction.INWARD), (outward, Direction.OUTWARD)):
        (event,) = run([rule("crossed", "door")], frames)
        assert (event.pulse, event.direction) == (2, direction)
        assert run([rule("crossed", "door", direction=direction)], frames) == [event]
    assert run([rule("crossed", "door", direction=Direction.OUTWARD)], inward) == []


def test_who_goes_round_the_end_of_a_line_does_not_cross_it() -> None:
    frames = [{1: (5.0, y)} for y in (-2, -1, 1, 2)] + [{1: (1.0, 2.0)}] * 5
    assert run([rule("crossed", "door")], frames) == []


@settings(max_examples=100)
@given(st.lists(st.sampled_from([-2.0, -0.4, -0.1, 0.1, 0.4, 2.0]), min_size=1, max_size=150))
def test_crossings_alternate_in_direction(ys: list[float]) -> None:
    events = run([rule("crossed", "door")], [{1: (1.0, y)} for y in ys])
    directions = [event.direction for event in events]
    assert all(before is not after for before, after in itertools.pairwise(directions))


def test_a_stay_begins_after_its_time_and_ends_with_leaving() -> None:
    events = run([rule("stayed", longer_than=20)], walk(*[1.0] * 40, *[-2.0] * 10))
    assert told(events) == [("stayed", "began", 20, (1,)), ("stayed", "ended", 43, (1,))]
    assert run([rule("stayed", longer_than=20)], walk(*[1.0] * 15, *[-2.0] * 10)) == []


def test_a_crowd_begins_above_its_number_if_that_lasts() -> None:
    two, three = {1: (1.0, 1.0), 2: (2.0, 1.0)}, {1: (1.0, 1.0), 2: (2.0, 1.0), 3: (3.0, 1.0)}
    frames = [*[two] * 10, *[three] * 10, *[{**two, 3: (9.0, 9.0)}] * 12]
    events = run([rule("crowded", more_than=2, hold=4)], frames)
    assert [(event.phase, event.people) for event in events] == [
        (Phase.BEGAN, (1, 2, 3)),
        (Phase.ENDED, (1, 2, 3)),
    ]
    short = [*[two] * 10, *[three] * 6, *[{**two, 3: (9.0, 9.0)}] * 12]
    assert run([rule("crowded", more_than=2, hold=10)], short) == []


def test_a_crowd_may_be_anywhere() -> None:
    events = run([rule("crowded", None, more_than=1)], [{1: (50.0, 1.0), 2: (90.0, 1.0)}])
    assert told(events) == [("crowded", "began", 0, (1, 2))]


def test_two_people_are_close_until_they_are_a_margin_further_apart() -> None:
    def apart(distance: float) -> dict[int, Point]:
        return {1: (20.0, 0.0), 2: (20.0 + distance, 0.0), 3: (90.0, 0.0)}

    distances = [*[3.0] * 3, *[0.9] * 5, *[1.1] * 5, *[1.3] * 5]
    events = run(
        [rule("close", None, closer_than=1.0, margin=0.2, hold=2)], [apart(each) for each in distances]
    )
    assert told(events) == [("close", "began", 3, (1, 2)), ("close", "ended", 13, (1, 2))]


@pytest.mark.parametrize(("people", "expected"), [({1}, [1]), ({"Ann"}, [2]), ({9}, []), (set(), [1, 2])])
def test_rules_are_about_some_people(people: set[int | str], expected: list[int]) -> None:
    frames = [*[{1: (-2.0, 1.0), 2: (-2.0, 2.0)}] * 3, *[{1: (2.0, 1.0), 2: (2.0, 2.0)}] * 5]
    named = Circumstances(names={2: "Ann"}, clear=CAMERA, usable=CAMERA)
    events = run([rule("entered", people=frozenset(people))], frames, named)
    assert [event.people for event in events] == [(person,) for person in expected]


def test_a_rule_waits_for_its_cameras_to_be_clear() -> None:
    frames = walk(*[-2.0] * 3, *[1.0] * 5)
    dim = Circumstances(usable=CAMERA)
    assert run([rule("entered", cameras=CAMERA)], frames, dim) == []
    assert len(run([rule("entered")], frames, dim)) == 1


def test_a_merge_moves_a_visit_without_an_event() -> None:
    rules = [rule("entered"), rule("left"), Rule("s", RuleKind.STAYED, "till", longer_than=5)]
    evaluator = RuleEvaluator([TILL], rules, absent=10)
    for pulse, floor in enumerate(walk(*[1.0] * 10, person=7)):
        evaluator.step(frame(pulse, floor), SEEN)
    evaluator.merge(1, 7)
    later = [
        event for pulse in range(10, 30) for event in evaluator.step(frame(pulse, {1: (1.0, 2.0)}), SEEN)
    ]
    assert later == []
    assert evaluator.people_in == {"till": [1]}
    assert evaluator.lasting == {"s"}


def test_a_split_begins_where_the_other_is() -> None:
    evaluator = RuleEvaluator([TILL], [rule("entered"), rule("left")], absent=10)
    for pulse, floor in enumerate(walk(*[1.0] * 10)):
        evaluator.step(frame(pulse, floor), SEEN)
    evaluator.split(1, 2)
    assert evaluator.people_in == {"till": [1, 2]}
    assert evaluator.step(frame(10, {1: (1.0, 2.0), 2: (3.0, 2.0)}), SEEN) == []


def test_a_zone_in_a_picture_sees_only_its_camera() -> None:
    shelf = Area("shelf", ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)), camera="c1")
    evaluator = RuleEvaluator([shelf], [rule("entered", "shelf")], absent=10)
    both = {1: frozenset({"c0", "c1"})}
    elsewhere = PeopleOfFrame(0, {1: (50.0, 50.0)}, {"c0": {1: (50.0, 50.0)}, "c1": {1: (400.0, 50.0)}}, both)
    assert evaluator.step(elsewhere, SEEN) == []
    there = PeopleOfFrame(1, {1: (900.0, 9.0)}, {"c1": {1: (50.0, 50.0)}}, both)
    assert told(evaluator.step(there, SEEN)) == [("entered", "once", 1, (1,))]


@settings(max_examples=30)
@given(
    st.lists(st.dictionaries(st.integers(1, 4), st.tuples(st.floats(-6, 6), st.floats(-6, 6))), max_size=80)
)
def test_what_has_begun_ends_once_everyone_has_gone(frames: list[dict[int, Point]]) -> None:
    rules = [
        Rule("stay", RuleKind.STAYED, "till", longer_than=3),
        Rule("crowd", RuleKind.CROWDED, "till", more_than=1, hold=1),
        Rule("pair", RuleKind.CLOSE, closer_than=2.0, margin=0.5, hold=1),
    ]
    evaluator = RuleEvaluator([TILL, DOOR], rules, absent=10)
    gone: list[dict[int, Point]] = [{} for _ in range(20)]
    events = [
        event
        for pulse, floor in enumerate([*frames, *gone])
        for event in evaluator.step(frame(pulse, floor), SEEN)
    ]
    for each in rules:
        phases = [event.phase for event in events if event.rule == each.name]
        assert phases.count(Phase.BEGAN) == phases.count(Phase.ENDED)
    assert evaluator.lasting == frozenset()
    assert evaluator.people_in == {"till": []}
