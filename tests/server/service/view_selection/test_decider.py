"""View selection: larger boxes win, cuts are at GOP starts, missing frames are not selected."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    LARGE,
    SMALL,
    STRIDE,
    TrackNumbers,
    camera_tracks,
    epoch_of,
    small_config,
)
from server.messaging.messages import Box
from server.service.decision_state import DecisionState, reason
from server.service.view_selection.decider import GopDecision, ViewDecider

Seen = Mapping[str, Mapping[int, Box | None]]
A, B = CAMERAS
EVERY_FRAME: Callable[[str, int], bool] = lambda _camera, _pulse: True  # noqa: E731 — a default of the tests


def decider(has: Callable[[str, int], bool] = EVERY_FRAME, **changes: Any) -> ViewDecider:
    view_decider = ViewDecider(small_config(**changes), dict.fromkeys(CAMERAS), has)
    view_decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    return view_decider


def decide(view_decider: ViewDecider, story: Sequence[Seen], *, end: int | None = None) -> list[GopDecision]:
    """Feed a scripted scene epoch by epoch; ``end`` is the last frame of ended recordings."""
    decisions = []
    for number, seen in enumerate(story):
        decisions += view_decider.step(
            epoch_of(number, *(camera_tracks(camera, number, boxes) for camera, boxes in seen.items()))
        )
    return decisions + ([] if end is None else view_decider.finish(end))


def shown(decisions: list[GopDecision], number: int = 1) -> list[str | None]:
    return [choice.camera for decision in decisions for choice in decision.choices if choice.number == number]


def reason_of(decision: GopDecision) -> str:
    return reason(decision.choices[0], decision.reasons.of(decision.choices[0].number))


def test_a_gop_is_decided_when_its_look_ahead_is_known() -> None:
    view_decider = decider()
    assert decide(view_decider, [{A: {1: SMALL}, B: {}}]) == []
    [decision] = view_decider.step(epoch_of(1, camera_tracks(A, 1, {1: SMALL}), camera_tracks(B, 1, {})))
    assert (decision.first, decision.frames) == (0, GOP)


def test_the_camera_with_the_bigger_box_shows_the_person() -> None:
    decisions = decide(decider(), [{A: {1: SMALL}, B: {1: LARGE}}] * 4)
    assert shown(decisions) == [B, B, B]
    views = decisions[-1].reasons.of(1).views
    assert views[B].cost == 0.0
    assert views[A].cost == pytest.approx(1 - (views[A].quality or 0.0) / (views[B].quality or 0.0))


def test_a_little_better_is_not_worth_a_cut_and_much_better_is() -> None:
    larger: Box = (20.0, 4.0, 36.5, 44.0)
    before: Seen = {A: {1: LARGE}, B: {1: SMALL}}
    between: Seen = {A: {1: LARGE}, B: {1: larger}}
    after: Seen = {A: {1: SMALL}, B: {1: LARGE}}
    decisions = decide(decider(), [before] * 2 + [between] * 3 + [after] * 3)
    assert shown(decisions) == [A, A, A, A, B, B, B]
    assert "a little better than c0, but not enough" in reason_of(decisions[2])


def test_a_person_seen_by_a_single_camera_is_shown_by_it() -> None:
    decisions = decide(decider(), [{A: {}, B: {1: SMALL}}] * 3)
    assert shown(decisions) == [B, B]


def test_views_change_only_at_gops_and_boxes_are_of_their_frames() -> None:
    story = [{A: {1: LARGE}, B: {}}] * 3 + [{A: {}, B: {}}] * 3
    decisions = decide(decider(), story, end=6 * STRIDE - 1)
    assert [decision.first for decision in decisions] == [n * GOP for n in range(6)]
    for decision in decisions:
        assert all(len(frames) == decision.frames for frames in decision.boxes.values())
    assert decisions[0].boxes[A] == [[(1, *LARGE)]] * GOP
    assert decisions[3].boxes[A] == [[]] * GOP


def test_a_camera_with_a_missing_frame_is_not_selected_for_the_gop() -> None:
    view_decider = decider(has=lambda camera, pulse: (camera, pulse) != (A, GOP + 2))
    decisions = decide(view_decider, [{A: {1: LARGE}, B: {}}] * 5, end=5 * STRIDE - 1)
    assert shown(decisions) == [A, B, A, A, A]
    assert decisions[1].reasons.of(1).views[A].cost is None


def test_no_camera_is_selected_while_none_can_be_shown() -> None:
    view_decider = decider(has=lambda _camera, pulse: pulse // GOP != 1)
    decisions = decide(view_decider, [{A: {1: LARGE}, B: {}}] * 5, end=5 * STRIDE - 1)
    assert shown(decisions) == [A, None, A, A, A]
    assert reason_of(decisions[1]) == "No camera can be shown at the moment."


@pytest.mark.parametrize("left", range(1, GOP + 1))
def test_finishing_decides_the_rest_including_a_partial_gop(left: int) -> None:
    end = 2 * GOP + left - 1
    decisions = decide(decider(), [{A: {1: LARGE}, B: {}}] * 3, end=end)
    assert [(decision.first, decision.frames) for decision in decisions] == [
        (0, GOP),
        (GOP, GOP),
        (2 * GOP, left),
    ]
    assert shown(decisions) == [A] * 3
    assert all(len(frames) == left for frames in decisions[-1].boxes.values())


def test_finishing_without_epochs_decides_nothing() -> None:
    assert decider().finish(100) == []


def test_a_service_started_within_a_gop_begins_with_the_next() -> None:
    view_decider = decider(encode={"gop_s": 0.4}, view={"lookahead_s": 0.8})
    decisions = []
    for number in range(5, 12):
        decisions += view_decider.step(epoch_of(number, camera_tracks(A, number, {1: SMALL})))
    assert [decision.first for decision in decisions] == [30, 40]


@settings(deadline=None, max_examples=15)
@given(
    st.lists(
        st.fixed_dictionaries(
            {
                camera: st.dictionaries(st.integers(1, 3), st.sampled_from([SMALL, LARGE, None]), max_size=3)
                for camera in CAMERAS
            }
        ),
        min_size=1,
        max_size=8,
    ),
    st.sets(st.tuples(st.sampled_from(CAMERAS), st.integers(0, 39)), max_size=5),
)
def test_decisions_are_deterministic_and_show_no_missing_frames(
    story: list[Seen], missing: set[tuple[str, int]]
) -> None:
    end = len(story) * STRIDE - 1
    one, two = (
        decide(decider(has=lambda camera, pulse: (camera, pulse) not in missing), story, end=end)
        for _ in "12"
    )
    assert one == two
    assert sum(decision.frames for decision in one) == end + 1
    for decision in one:
        for choice in decision.choices:
            for pulse in range(decision.first, decision.first + decision.frames):
                assert (choice.camera, pulse) not in missing


def test_a_cut_is_published_once_with_both_cameras() -> None:
    view_decider = decider(has=lambda camera, pulse: (camera, pulse // GOP) != (A, 1))
    state = DecisionState(25.0)
    gop_choices = [
        state.put(decision) for decision in decide(view_decider, [{A: {1: LARGE}, B: {}}] * 4, end=19)
    ]
    assert [
        [(cut.from_camera, cut.to_camera, cut.pulse) for cut in choice.cuts] for choice in gop_choices
    ] == [
        [],
        [(A, B, GOP)],
        [(B, A, 2 * GOP)],
        [],
    ]
    assert state.cuts == 2
    assert state.selected_views[1].since == 2 * GOP
    assert state.selected_views[1].cameras == (A,)
    assert gop_choices[0].choices == {1: A}
    assert gop_choices[0].boxes[A][0] == [(1, *LARGE)]


def test_the_same_camera_after_a_gap_is_no_cut() -> None:
    view_decider = decider(has=lambda _camera, pulse: pulse // GOP != 1)
    state = DecisionState(25.0)
    for decision in decide(view_decider, [{A: {1: LARGE}, B: {}}] * 4, end=19):
        state.put(decision)
    assert state.cuts == 0


def test_every_selection_has_a_one_sentence_reason() -> None:
    story: list[Seen] = [{A: {1: LARGE}, B: {}}] * 2
    only_a = decide(decider(has=lambda camera, _pulse: camera == A), story)[0]
    assert reason_of(only_a) == "c0 is the only camera that can be shown."
    best = decide(decider(), story)[0]
    assert reason_of(best) == "c0 sees this person best over the next frames."
    away = decide(decider(), [*story, *[{A: {}, B: {}}] * 3])[-1]
    assert reason_of(away) == "No camera sees this person at the moment; c0 saw them last."


def test_a_camera_that_dies_within_the_look_ahead_is_left_at_that_gop() -> None:
    dies = 2 * GOP + 2
    story: list[Seen] = [{A: {1: LARGE}, B: {1: SMALL}}] * 8
    alive = {A: 10 * GOP}
    view_decider = decider(has=lambda camera, pulse: pulse < alive.get(camera, pulse + 1))
    before = decide(
        view_decider, story[:3]
    )  # decides GOPs 0 and 1; the look-ahead of the second ends with GOP 2
    alive[A] = dies
    after = []
    for number in range(3, 8):  # its last words are lost with it
        after += view_decider.step(epoch_of(number, camera_tracks(B, number, story[number][B])))
    assert shown(before) == [A, A]
    assert shown(after) == [B, B, B, B, B], "no gap, and one cut"
    assert after[0].reasons.of(1).views[A].cost is None


def test_the_look_ahead_is_evaluated_again_without_a_dead_camera() -> None:
    story: list[Seen] = [{A: {1: LARGE}, B: {1: SMALL}}] * 3
    late = decider(
        has=lambda camera, pulse: camera == B or pulse < 2 * GOP, view={"lookahead_s": 4 * GOP / FPS}
    )
    early = decide(late, [*story, *[{B: {1: SMALL}}] * 4])
    assert shown(early) == [A, A, B, B]
    sum_ahead = early[0].reasons.of(1)
    assert sum_ahead.stay is None
    assert sum_ahead.views[A].cost is None, "it cannot be shown to the end of the look-ahead"
    assert reason_of(early[0]) == "c0 is shown for as long as it can be: some of its next frames are missing."


def test_the_reason_announces_a_planned_cut() -> None:
    story: list[Seen] = [{A: {1: LARGE}, B: {1: SMALL}}] * 3 + [{A: {1: SMALL}, B: {1: LARGE}}] * 7
    decisions = decide(decider(view={"lookahead_s": 4 * GOP / FPS, "switch_cost_s": 0.04}), story)
    last = shown(decisions).index(B) - 1
    reasons = decisions[last].reasons.of(1)
    assert reasons.stay is not None
    assert reasons.cut is not None
    assert reasons.stay > reasons.cut, "for the whole look-ahead the other one would be better"
    assert (
        reason_of(decisions[last])
        == "Another camera will see this person better than c0: it is too soon to cut."
    )


@pytest.mark.parametrize(("min_shot_s", "cuts"), [(0.0, 4), (0.5, 2)])
def test_shots_have_the_minimum_length(min_shot_s: float, cuts: int) -> None:
    larger_in_a: Seen = {A: {1: LARGE}, B: {1: SMALL}}
    larger_in_b: Seen = {A: {1: SMALL}, B: {1: LARGE}}
    story = [
        larger_in_a,
        larger_in_a,
        larger_in_b,
        larger_in_b,
        larger_in_a,
        larger_in_a,
        larger_in_b,
        larger_in_b,
        larger_in_a,
        larger_in_a,
        larger_in_a,
    ]
    view_decider = decider(view={"min_shot_s": min_shot_s})
    views = shown(decide(view_decider, story, end=11 * STRIDE - 1))
    changes = [n for n in range(1, len(views)) if views[n] != views[n - 1]]
    assert len(changes) == cuts
    assert all(b - a >= view_decider.min_shot_gops for a, b in itertools.pairwise(changes))


def test_a_shot_without_the_person_may_be_short() -> None:
    larger_in_a, hidden_in_a = {A: {1: LARGE}, B: {1: SMALL}}, {A: {}, B: {1: SMALL}}
    view_decider = decider(view={"min_shot_s": 2.0})
    assert shown(decide(view_decider, [larger_in_a, larger_in_a, *[hidden_in_a] * 4])) == [A, A, B, B, B]


def test_a_track_that_changes_person_within_the_window_counts_for_each_in_their_frames() -> None:
    view_decider = decider()
    changes = STRIDE + 2
    view_decider.people.numbers = lambda keys, first, frames: np.where(  # type: ignore[method-assign]
        first + np.arange(frames) < changes, 1, 2
    )[None].repeat(len(keys), axis=0)
    decisions = decide(view_decider, [{A: {1: LARGE}, B: {}}] * 4)
    assert [[number for number, *_ in frame] for frame in decisions[1].boxes[A]] == [[1], [1], [2], [2], [2]]
    assert decisions[1].reasons.of(1).views[A].seen == pytest.approx(2 / (2 * GOP))


def test_with_relative_quality_distance_makes_no_difference() -> None:
    tiny: Box = (30.0, 30.0, 31.0, 33.0)
    half: Box = (30.0, 30.0, 30.5, 31.5)
    story: list[Seen] = [{A: {1: tiny}, B: {1: half}}] * 3 + [{A: {1: half}, B: {1: tiny}}] * 3
    assert shown(decide(decider(), story)) == [A, A, A, B, B]
    papers = decider(view={"quality": {"relative": False}})
    assert shown(decide(papers, story)) == [A] * 5, "the paper's cost of a cut is of a picture full of them"


@pytest.mark.parametrize(("presence_decay_s", "expected"), [(0.0, [A, B, A, A]), (1.0, [A, A, A, A])])
def test_a_short_missed_detection_causes_no_cuts(presence_decay_s: float, expected: list[str]) -> None:
    larger_in_a, missed = {A: {1: LARGE}, B: {1: SMALL}}, {A: {}, B: {1: SMALL}}
    view_decider = decider(view={"presence_decay_s": presence_decay_s})
    assert (
        shown(decide(view_decider, [larger_in_a, missed, larger_in_a, larger_in_a, larger_in_a])) == expected
    )


def test_a_camera_that_keeps_missing_the_person_is_left_eventually() -> None:
    larger_in_a, hidden_in_a = {A: {1: LARGE}, B: {1: SMALL}}, {A: {}, B: {1: SMALL}}
    views = shown(decide(decider(view={"presence_decay_s": 1.0}), [larger_in_a, *[hidden_in_a] * 8]))
    assert (views[0], views[-1]) == (A, B)
    assert [a != b for a, b in itertools.pairwise(views)].count(True) == 1
