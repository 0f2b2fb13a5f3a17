"""The benchmark of the help: what counts as a failure, and what the simulated operator can know."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from benchmarks.assist_cases import count
from benchmarks.assist_desk import Desk
from benchmarks.assist_failures import failures, matches
from benchmarks.assist_operator import Operator, Person
from benchmarks.assist_school import school
from benchmarks.assist_watch import FISH, watch
from benchmarks.experiments_scene import Truth
from server.wire.sections import Flags
from tracking.assist import Trouble

FRAMES = 200
FPS = 25.0
ALL = Flags(per_minute=600, risk=0.0)


def _truth() -> Truth:
    """Two fish on lines of their own, far from each other."""
    frames = np.arange(FRAMES)
    boxes = np.stack(
        [np.stack([frames, frames * 0 + y, frames + 60, frames * 0 + y + 20], 1) for y in (0, 300)]
    )
    return Truth(boxes.astype(np.float64), np.ones((2, FRAMES)))


def _tracks(truth: Truth, numbers: Sequence[Sequence[int]]) -> dict[int, dict[int, np.ndarray]]:
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
    operator = Operator(Person(reaction_s=0.4, error=0.0, delay_s=1.0), Desk(ALL, FPS), truth, FPS, seed=1)
    operator.hear(60, [Trouble("exchange", (2, 1), 55, 0.1, 5, 0.5)])
    said = {newest: operator.look(newest, shown) for newest in range(60, 100)}
    assert all(said[newest] is None for newest in range(60, 70))
    first = said[70]
    assert first is not None
    assert (first.frame, first.object) == (45, 2)
    assert (first.x, first.y) == (45 + 30.0, 310.0)


def test_who_is_under_the_wrong_box_when_the_operator_looks_is_followed_wrongly() -> None:
    """The operator knows no more than the screen: there the two had changed places already."""
    truth = _truth()
    shown = _tracks(truth, [[2] * FRAMES, [1] * FRAMES])
    operator = Operator(Person(delay_s=0.0), Desk(ALL, FPS), truth, FPS, seed=1)
    operator.hear(60, [Trouble("exchange", (2, 1), 55, 0.1, 5, 0.5)])
    for newest in range(60, 80):
        operator.look(newest, shown)
    assert operator.flags[0].fish == 0


def test_a_second_flag_waits_until_the_first_is_over_and_is_let_be_if_all_is_over_then() -> None:
    truth = _truth()
    shown = _tracks(truth, [[1] * FRAMES, [2] * FRAMES])
    for due, seen_to in ((150, True), (61, False)):
        operator = Operator(Person(delay_s=0.0), Desk(ALL, FPS), truth, FPS, seed=1)
        operator.hear(60, [_trouble((1, 8), 60, 0.9), _trouble((2, 7), due, 0.5)])
        pointings = [operator.look(newest, shown) for newest in range(60, 200)]
        assert [flag.trouble.objects for flag in operator.flags] == [(1, 8), (2, 7)]
        first, second = operator.flags
        assert first.fish == 0
        assert (second.fish == 1) == seen_to
        assert {it.object for it in pointings if it} == ({1, 2} if seen_to else {1})


def test_flags_go_to_the_riskiest_and_once_to_the_same_two() -> None:
    desk = Desk(Flags(per_minute=2), FPS)
    desk.begin()
    first = desk.raised(10, [_trouble((1, 2), 10, 0.2), _trouble((3, 4), 10, 0.8), _trouble((5, 6), 10, 0.5)])
    assert [it.objects for it in first] == [(3, 4), (5, 6)]
    assert desk.raised(15, [_trouble((4, 3), 15, 0.9), _trouble((1, 2), 15, 0.2)]) == []


def _trouble(objects: tuple[int, int], frame: int, risk: float) -> Trouble:
    return Trouble("exchange", objects, frame, 0.1, 5, risk)


@pytest.mark.slow
def test_a_school_is_played_again_from_its_seed_and_helped_it_fails_no_more_than_alone() -> None:
    clip = school(8, seconds=18.0)
    again = school(8, seconds=18.0)
    assert all((one.boxes == other.boxes).all() for one, other in zip(clip.seen, again.seen, strict=True))
    alone, helped = watch(clip, FISH), watch(clip, FISH, Person())
    assert alone.failures
    assert len(helped.failures) < len(alone.failures)
    cases = count([(alone, helped)], Person())
    assert cases.unaided.total() == len(alone.failures)
    assert cases.left.total() == len(helped.failures)
    assert cases.flags.total() == len(helped.flags)
    assert cases.minutes == pytest.approx(0.3)
