"""The benchmark of the help: what counts as a failure, and what the simulated operator can know."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from benchmarks.assist_cases import count
from benchmarks.assist_failures import failures, matches
from benchmarks.assist_operator import Operator, Person
from benchmarks.assist_school import school
from benchmarks.assist_watch import FISH, watch
from benchmarks.experiments_scene import Truth
from tracking.assist import Trouble

FRAMES = 200
FPS = 25.0


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
    operator = Operator(Person(reaction_s=0.4, error=0.0, delay_s=1.0), truth, FPS, seed=1)
    operator.hear(60, [Trouble("exchange", (2, 1), 55, 0.1)])
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
    operator = Operator(Person(delay_s=0.0), truth, FPS, seed=1)
    operator.hear(60, [Trouble("exchange", (2, 1), 55, 0.1)])
    for newest in range(60, 80):
        operator.look(newest, shown)
    assert operator.flags[0].fish == 0


def test_a_second_flag_waits_until_the_first_is_over() -> None:
    operator = Operator(Person(), _truth(), FPS, seed=1)
    operator.hear(60, [Trouble("exchange", (1, 2), 55, 0.1), Trouble("fading", (7,), 60, 0.0)])
    assert [flag.trouble.objects for flag in operator.flags] == [(1, 2)]
    assert [trouble.objects for trouble in operator.missed] == [(7,)]


@pytest.mark.slow
def test_a_school_is_played_again_from_its_seed_and_helped_it_fails_no_more_than_alone() -> None:
    clip = school(8, seconds=18.0)
    again = school(8, seconds=18.0)
    assert all((one.boxes == other.boxes).all() for one, other in zip(clip.seen, again.seen, strict=True))
    alone, helped = watch(clip, FISH, None), watch(clip, FISH, Person())
    assert alone.failures
    assert len(helped.failures) < len(alone.failures)
    cases = count([(alone, helped)], Person())
    assert cases.unaided.total() == len(alone.failures)
    assert cases.left.total() == len(helped.failures)
    assert cases.flags.total() == len(helped.flags)
    assert cases.minutes == pytest.approx(0.3)
