"""The overhead scene: people meet, stand so close that they are one blob, and part."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthetic import Scene
from synthetic.cameras.pinhole import PinholeCamera, Viewpoint
from synthetic.drawing.clothing import choose_outfit_with_lookalikes
from synthetic.room.layouts import OVERHEAD, OVERHEAD_AREA
from synthetic.walking.choreographed_crowd import ROUND, ChoreographedCrowd, sample_times
from synthetic.walking.collision_avoidance import push_paths_apart
from synthetic.walking.gatherings import Gatherings, plan_gathering

RATE = 10  # samples a second
SIZE = (320, 180)


def crowd(people: int, seed: int) -> ChoreographedCrowd:
    return ChoreographedCrowd(
        Gatherings(OVERHEAD_AREA, people, seed), [1.65 + 0.05 * walker for walker in range(people)]
    )


@cache
def paths(people: int, seed: int, seconds: int = 120) -> np.ndarray:
    """Return the sampled paths of a crowd: ``(T, people, 2)`` meters."""
    walkers = crowd(people, seed)
    return np.array([[(pose.x, pose.y) for pose in walkers.poses(t / RATE)] for t in range(seconds * RATE)])


def gaps(people_paths: np.ndarray) -> np.ndarray:
    """Return the distances of all pairs: ``(T, pairs)`` meters."""
    apart = np.linalg.norm(people_paths[:, :, None] - people_paths[:, None], axis=3)
    return apart[:, *np.triu_indices(people_paths.shape[1], 1)]


@pytest.mark.parametrize("people", [2, 4])
@pytest.mark.parametrize("seed", range(2))
def test_people_meet_and_part_again_several_times_a_minute(people: int, seed: int) -> None:
    together = gaps(paths(people, seed)) < 0.6
    meetings = (np.diff(together.astype(int), axis=0) == 1).sum()
    partings = (np.diff(together.astype(int), axis=0) == -1).sum()
    assert meetings >= 2 * 4  # in two minutes
    assert partings >= meetings - 1
    assert 0.05 < together.any(axis=1).mean() < 0.8


@pytest.mark.parametrize("people", [2, 4])
@pytest.mark.parametrize("seed", range(2))
def test_people_do_not_collide_or_leave(people: int, seed: int) -> None:
    people_paths = paths(people, seed)
    assert gaps(people_paths).min() > 0.2  # meters: about the depth of a body
    assert np.mean(gaps(people_paths) < 0.4) < 0.02
    assert (people_paths > (OVERHEAD_AREA[0] - 0.4, OVERHEAD_AREA[1] - 0.4)).all()
    assert (people_paths < (OVERHEAD_AREA[2] + 0.4, OVERHEAD_AREA[3] + 0.4)).all()
    for west, south, east, north in OVERHEAD.footprints():
        assert not ((people_paths > (west, south)) & (people_paths < (east, north))).all(axis=2).any()


def test_rounds_join_without_a_jump() -> None:
    walkers = crowd(4, 2)
    for number in range(1, 6):
        before, after = walkers.poses(number * ROUND - 1e-6), walkers.poses(number * ROUND)
        for one, other, height in zip(before, after, (1.65, 1.7, 1.75, 1.8), strict=True):
            assert np.hypot(one.x - other.x, one.y - other.y) < 1e-3
            assert abs(np.sin((one.heading - other.heading) / 2)) < 0.02
            steps = (one.walked - other.walked) / (0.69 * height)
            assert abs(steps - round(steps)) < 0.01  # the phase of the legs continues


def test_people_walk_at_a_plausible_speed() -> None:
    people_paths = paths(4, 1)
    speed = np.hypot(*np.diff(people_paths, axis=0).transpose(2, 0, 1)) * RATE
    assert speed.max() < 2.0
    assert 0.3 < np.median(speed) < 1.2


def test_people_are_apart_at_the_beginning() -> None:
    assert min(gaps(paths(4, seed, 1))[0].min() for seed in range(5)) > 1.2


@settings(deadline=None, max_examples=30)
@given(people=st.integers(0, 8), seed=st.integers(0, 1000))
def test_a_round_leads_every_person_from_start_to_end(people: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    starts, ends = rng.uniform(OVERHEAD_AREA[:2], OVERHEAD_AREA[2:], (2, people, 2))
    plan = plan_gathering(rng, starts, ends, OVERHEAD_AREA)
    assert len(plan) == people
    for path, start, end in zip(plan, starts, ends, strict=True):
        assert (np.diff(path.times) >= -1e-9).all()
        assert np.allclose(path.at(sample_times()[[0, -1]]), [start, end])


@settings(deadline=None, max_examples=40)
@given(offsets=st.floats(-0.5, 0.5), speed=st.floats(0.4, 1.4))
def test_two_people_who_meet_head_on_pass_each_other(offsets: float, speed: float) -> None:
    clock = np.arange(60) / 5 - 6
    one = np.column_stack([speed * clock, np.zeros(60)])
    other = np.column_stack([-speed * clock, np.full(60, offsets)])
    keep = np.full((2, 2), 0.7)
    bent = push_paths_apart(np.array([one, other]), keep, 5.0)
    apart = np.linalg.norm(bent[0] - bent[1], axis=1)
    assert apart.min() > 0.6
    assert np.array_equal(bent[:, [0, -1]], np.array([one, other])[:, [0, -1]])


def test_a_camera_that_looks_straight_down_has_north_on_top() -> None:
    view = PinholeCamera.at(Viewpoint((2.0, 3.0, 5.0), (2.0, 3.0, 0.0)), *SIZE)
    pixels, depth = view.project(np.array([[2.0, 3.0, 0.0], [2.0, 4.0, 0.0], [3.0, 3.0, 0.0]]))
    assert np.allclose(depth, 5.0)
    middle, north, east = pixels
    assert np.allclose(middle, (160, 90))
    assert north[0] == pytest.approx(160) and north[1] < 90  # noqa: PT018 — one place
    assert east[1] == pytest.approx(90) and east[0] > 160  # noqa: PT018
    assert np.allclose(view.homography() @ (*east, 1.0), (3.0, 3.0, 1.0))


def test_boxes_are_where_the_picture_differs_and_people_lean_outwards() -> None:
    scene = Scene("overhead", 1, 1, 4, *SIZE)
    empty = scene.clean_background(0).astype(np.int16)
    matrix = scene.homography(0)
    assert matrix is not None
    outwards = []
    for frame in range(0, 1500, 50):
        (truth,) = scene.truth(frame)
        assert truth.ids.tolist() == [1]
        changed = np.abs(scene.image(0, frame).astype(np.int16) - empty).max(axis=2) > 50
        x, y, width, height = cv2.boundingRect(cv2.medianBlur(changed.astype(np.uint8), 3))
        left, top, right, bottom = truth.boxes[0]
        assert x >= left - 6 and y >= top - 6  # noqa: PT018 — one corner
        assert x + width <= right + 6 and y + height <= bottom + 6  # noqa: PT018 — the shadow is fainter
        assert width * height > 0.5 * (right - left) * (bottom - top)
        floor = matrix @ ((left + right) / 2, (top + bottom) / 2, 1.0)
        middle = np.array(scene.floor) / 2
        where = scene.ground_positions(frame)[0]
        outwards.append(np.linalg.norm(floor[:2] - middle) - np.linalg.norm(where - middle))
    assert np.mean(outwards) > 0.1


def test_people_who_stand_together_are_one_blob_and_people_apart_are_several() -> None:
    """Compare with the empty room, as a background model does, for two people."""
    scene = Scene("overhead", 1, 2, 1)
    empty = scene.clean_background(0).astype(np.int16)
    near, far = [], []
    for frame in range(0, 1500, 15):
        gap = np.linalg.norm(np.subtract(*scene.ground_positions(frame)))
        if not (gap < 0.55 or gap > 1.6):
            continue
        changed = np.abs(scene.image(0, frame).astype(np.int16) - empty).max(axis=2) > 25
        closed = cv2.morphologyEx(changed.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
        areas = cv2.connectedComponentsWithStats(closed)[2][1:, cv2.CC_STAT_AREA]
        (near if gap < 0.55 else far).append(int((areas > 200).sum()))
    assert len(near) > 5 and len(far) > 5  # noqa: PT018
    assert np.mean(np.array(near) == 1) > 0.8
    assert np.mean(np.array(far) >= 2) > 0.8


def test_some_people_dress_alike_and_most_do_not() -> None:
    alike = [
        np.linalg.norm(
            np.subtract(
                choose_outfit_with_lookalikes(0, seed).upper, choose_outfit_with_lookalikes(1, seed).upper
            )
        )
        < 0.15
        for seed in range(200)
    ]
    assert 0.2 < np.mean(alike) < 0.45
