"""The operator assistance benchmark: identity failures, and the simulated operator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from benchmarks.operator_assist.assisted_tracking import FISH, TrackedClip, track_clip
from benchmarks.operator_assist.clips import Clip
from benchmarks.operator_assist.fish_school import simulate_school
from benchmarks.operator_assist.flag_outcomes import Outcome, count
from benchmarks.operator_assist.flag_selection import FlagSelector
from benchmarks.operator_assist.identity_failures import Kind, failures, matches
from benchmarks.operator_assist.outcome_table import texts
from benchmarks.operator_assist.simulated_operator import OperatorFlag, OperatorProfile, SimulatedOperator
from benchmarks.paper_experiments.scene import ObjectTruth
from server.config.sections import FlagSettings
from tracking import Detections
from tracking.interactive import RiskEvent, RiskReason

FRAMES = 200
FPS = 25.0
ALL = FlagSettings(per_minute=600, risk=0.0)


def _truth() -> ObjectTruth:
    """Two fish on lines of their own, far from each other."""
    frames = np.arange(FRAMES)
    boxes = np.stack(
        [np.stack([frames, frames * 0 + y, frames + 60, frames * 0 + y + 20], 1) for y in (0, 300)]
    )
    return ObjectTruth(boxes.astype(np.float64), np.ones((2, FRAMES)))


def _tracks(truth: ObjectTruth, numbers: Sequence[Sequence[int]]) -> dict[int, dict[int, np.ndarray]]:
    """Tracks that are exactly at fish n in frame t, of the number `numbers[n][t]`; 0: no track."""
    return {t: {row[t]: truth.boxes[n, t] for n, row in enumerate(numbers) if row[t]} for t in range(FRAMES)}


def test_right_tracks_do_not_fail_and_an_exchange_is_one_failure() -> None:
    truth = _truth()
    right = [[1] * FRAMES, [2] * FRAMES]
    assert failures(truth, _tracks(truth, right), FPS) == []
    exchanged = [[1] * 100 + [2] * 100, [2] * 100 + [1] * 100]
    (failure,) = failures(truth, _tracks(truth, exchanged), FPS)
    assert (failure.before, failure.frame, failure.fish, failure.tracks) == (99, 100, (0, 1), (1, 2))


def test_a_moment_under_another_number_is_no_failure_and_a_new_number_after_a_gap_is_one() -> None:
    truth = _truth()
    moment = [[1] * 100 + [3] * 4 + [1] * 96, [2] * FRAMES]
    assert failures(truth, _tracks(truth, moment), FPS) == []
    gap = [[1] * 80 + [0] * 40 + [3] * 80, [2] * FRAMES]
    (failure,) = failures(truth, _tracks(truth, gap), FPS)
    assert (failure.before, failure.frame, failure.kind) == (79, 120, "alone")
    assert (matches(truth, _tracks(truth, gap))[0, 80:120] == 0).all()


def test_the_operator_points_at_what_was_on_the_late_screen_once_they_have_reacted() -> None:
    truth = _truth()
    shown = _tracks(truth, [[1] * FRAMES, [2] * FRAMES])
    operator = SimulatedOperator(
        OperatorProfile(reaction_s=0.4, error=0.0, delay_s=1.0), FlagSelector(ALL, FPS), truth, FPS, seed=1
    )
    operator.receive(60, [RiskEvent("id_switch", (2, 1), 55, 0.1, 5, 0.5)])
    said = {newest: operator.point(newest, shown) for newest in range(60, 100)}
    assert all(said[newest] is None for newest in range(60, 70))
    first = said[70]
    assert first is not None
    assert (first.frame, first.object) == (45, 2)
    assert (first.x, first.y) == (45 + 30.0, 310.0)


def test_who_is_under_the_wrong_box_when_the_operator_looks_is_followed_wrongly() -> None:
    """The operator knows no more than the screen: there the two had changed places already."""
    truth = _truth()
    shown = _tracks(truth, [[2] * FRAMES, [1] * FRAMES])
    operator = SimulatedOperator(OperatorProfile(delay_s=0.0), FlagSelector(ALL, FPS), truth, FPS, seed=1)
    operator.receive(60, [RiskEvent("id_switch", (2, 1), 55, 0.1, 5, 0.5)])
    for newest in range(60, 80):
        operator.point(newest, shown)
    assert operator.flags[0].fish == 0


def test_a_second_flag_waits_until_the_first_is_over_and_is_let_be_if_all_is_over_then() -> None:
    truth = _truth()
    shown = _tracks(truth, [[1] * FRAMES, [2] * FRAMES])
    for due, seen_to in ((150, True), (61, False)):
        person = OperatorProfile(delay_s=0.0, back_s=0.0)
        operator = SimulatedOperator(person, FlagSelector(ALL, FPS), truth, FPS, seed=1)
        operator.receive(60, [_event((1, 8), 60, 0.9), _event((2, 7), due, 0.5)])
        pointings = [operator.point(newest, shown) for newest in range(60, 200)]
        assert [flag.event.objects for flag in operator.flags] == [(1, 8), (2, 7)]
        first, second = operator.flags
        assert first.fish == 0
        assert (second.fish == 1) == seen_to
        assert {pointing.object for pointing in pointings if pointing} == ({1, 2} if seen_to else {1})


def test_what_is_over_when_the_first_is_over_is_seen_again_from_a_moment_before() -> None:
    truth = _truth()
    shown = _tracks(truth, [[1] * FRAMES, [2] * FRAMES])
    operator = SimulatedOperator(
        OperatorProfile(delay_s=0.0, back_s=8.0), FlagSelector(ALL, FPS), truth, FPS, seed=1
    )
    operator.receive(60, [_event((1, 8), 60, 0.9), _event((2, 7), 61, 0.5)])
    pointings = [operator.point(newest, shown) for newest in range(60, 200)]
    second = operator.flags[1]
    assert second.fish == 1
    assert second.begun is not None
    assert second.begun > 61
    assert second.pointing_frames[0] in range(40, 61)
    assert {pointing.object for pointing in pointings if pointing} == {1, 2}


def test_who_was_lost_long_ago_is_seen_again_when_they_were_still_there() -> None:
    truth = _truth()
    shown = _tracks(truth, [[1] * 60 + [0] * 140, [2] * FRAMES])
    operator = SimulatedOperator(OperatorProfile(delay_s=1.0), FlagSelector(ALL, FPS), truth, FPS, seed=1)
    operator.receive(120, [_event((1,), 60, 0.9)])
    first = next(event for newest in range(120, 200) if (event := operator.point(newest, shown)) is not None)
    assert (first.object, operator.flags[0].fish) == (1, 0)
    assert first.frame in range(45, 60)


def test_flags_go_to_the_riskiest_and_once_to_the_same_two() -> None:
    selector = FlagSelector(FlagSettings(per_minute=2), FPS)
    selector.begin()
    first = selector.raised(10, [_event((1, 2), 10, 0.2), _event((3, 4), 10, 0.8), _event((5, 6), 10, 0.5)])
    assert [event.objects for event in first] == [(3, 4), (5, 6)]
    assert selector.raised(15, [_event((4, 3), 15, 0.9), _event((1, 2), 15, 0.2)]) == []


def _event(objects: tuple[int, int], frame: int, risk: float) -> RiskEvent:
    return RiskEvent("id_switch", objects, frame, 0.1, 5, risk)


RIGHT = [[1] * FRAMES, [2] * FRAMES]
EXCHANGED = [[1] * 100 + [2] * 100, [2] * 100 + [1] * 100]


def _watched(
    truth: ObjectTruth, numbers: Sequence[Sequence[int]], flags: Sequence[OperatorFlag] = ()
) -> TrackedClip:
    """A clip of which is known what its tracks were, and what somebody was asked."""
    clip = Clip(0, FPS, (Detections.empty(4),) * FRAMES, truth)
    tracks = _tracks(truth, numbers)
    return TrackedClip(clip, failures(truth, tracks, FPS), [], list(flags), tracks)


@pytest.mark.parametrize(
    ("alone", "helped", "outcome"),
    [
        (EXCHANGED, EXCHANGED, "no help"),
        (EXCHANGED, RIGHT, "helped"),
        (RIGHT, EXCHANGED, "harmed"),
        (RIGHT, RIGHT, "not needed"),
    ],
)
@pytest.mark.parametrize("followed", [None, 0], ids=["nobody saw to it", "followed"])
def test_what_a_flag_was_good_for_is_told_by_the_fish_that_its_tracks_were_on(
    alone: list[list[int]], helped: list[list[int]], outcome: Outcome, followed: int | None
) -> None:
    truth = _truth()
    flag = OperatorFlag(_event((1, 2), 105, 0.5), 1, raised=90, until=105, fish=followed)
    outcome_counts = count([(_watched(truth, alone), _watched(truth, helped, [flag]))], OperatorProfile())
    assert {flag for _, flag in outcome_counts.flags} == {outcome}


def test_a_flag_about_others_than_those_who_fail_was_not_needed() -> None:
    truth = _truth()
    still = np.tile([500.0, 600.0, 560.0, 620.0], (1, FRAMES, 1))
    truth = ObjectTruth(np.concatenate([truth.boxes, still]), np.ones((3, FRAMES)))
    numbers = [*EXCHANGED, [3] * FRAMES]
    flag = OperatorFlag(_event((3, 9), 100, 0.5), 3, raised=100, until=100)
    outcome_counts = count([(_watched(truth, numbers), _watched(truth, numbers, [flag]))], OperatorProfile())
    assert dict(outcome_counts.flags) == {("alone", "not needed"): 1}


@pytest.mark.parametrize("reason", ["crossing", "track_loss"])
@pytest.mark.parametrize(("others", "kind"), [([], "alone"), ([100], "2 way"), ([98, 104], "3 way")])
def test_whether_others_were_in_the_way_is_told_by_where_they_were_and_not_by_the_reason(
    others: list[int], kind: Kind, reason: RiskReason
) -> None:
    """Of the first fish, which the others meet in these frames, and nowhere else."""
    boxes = _truth().boxes
    for number, frame in enumerate(others):
        rises = np.abs(np.arange(FRAMES) - frame)[:, None] * [0.0, 10.0, 0.0, 10.0]
        boxes = np.concatenate([boxes, (boxes[0] + (1 - 2 * number) * rises)[None]])
    truth = ObjectTruth(boxes, np.ones((len(boxes), FRAMES)))
    numbers = [[n + 1] * FRAMES for n in range(len(boxes))]
    numbers[0] = [1] * 100 + [9] * 100
    flag = OperatorFlag(RiskEvent(reason, (1,), 100, 0.1, 5, 0.5), 1, raised=99, until=100)
    watched = _watched(truth, numbers, [flag])
    outcome_counts = count([(watched, watched)], OperatorProfile())
    assert dict(outcome_counts.flags) == {(kind, "no help"): 1}
    assert dict(outcome_counts.kinds) == {kind: 1}, "of the failure and of its flag, the same"


def test_who_meets_others_long_before_or_after_its_flag_was_alone() -> None:
    boxes = _truth().boxes
    rises = np.abs(np.arange(FRAMES) - 30)[:, None] * [0.0, 10.0, 0.0, 10.0]
    truth = ObjectTruth(np.concatenate([boxes, (boxes[0] + rises)[None]]), np.ones((3, FRAMES)))
    flag = OperatorFlag(_event((1, 3), 100, 0.5), 1, raised=99, until=100)
    watched = _watched(truth, [*RIGHT, [3] * FRAMES], [flag])
    assert dict(count([(watched, watched)], OperatorProfile()).flags) == {("alone", "not needed"): 1}


def test_the_table_has_the_thesis_beside_it_for_as_many_minutes() -> None:
    truth = _truth()
    flag = OperatorFlag(_event((1, 2), 100, 0.5), 1, raised=99, until=100)
    outcome_counts = count([(_watched(truth, RIGHT), _watched(truth, EXCHANGED, [flag]))], OperatorProfile())
    rows = {row[0].strip(): row[1:] for row in texts(outcome_counts, thesis=True)}
    as_56_clips = str(56 * 20 * 25 // FRAMES)
    assert rows["flagged, tracked correctly"] == ["0", "0", "53"]
    assert rows["flagged, tracked wrongly"] == ["1", as_56_clips, "-"]
    assert rows["failures with help"] == ["1", as_56_clips, "39"]
    assert {len(row) for row in texts(outcome_counts, thesis=False)} == {2}


@pytest.mark.slow
def test_a_school_is_played_again_from_its_seed_and_helped_it_fails_no_more_than_alone() -> None:
    clip = simulate_school(8, seconds=18.0)
    again = simulate_school(8, seconds=18.0)
    assert all(
        (one.boxes == other.boxes).all() for one, other in zip(clip.detections, again.detections, strict=True)
    )
    alone, helped = track_clip(clip, FISH), track_clip(clip, FISH, OperatorProfile())
    assert alone.failures
    assert len(helped.failures) < len(alone.failures)
    outcome_counts = count([(alone, helped)], OperatorProfile())
    assert outcome_counts.unaided.total() == len(alone.failures)
    assert outcome_counts.left.total() == len(helped.failures)
    assert outcome_counts.flags.total() == len(helped.flags)
    assert outcome_counts.minutes == pytest.approx(0.3)
