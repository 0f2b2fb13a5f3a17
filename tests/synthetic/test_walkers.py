"""People walk plausibly: steadily, around furniture and each other, and out by the doors."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthetic import Scene
from synthetic.drawing.clothing import choose_distinct_outfit
from synthetic.drawing.ray_casting import FAR, hit_distances_and_normals, may_intersect
from synthetic.drawing.skeleton import Joint, place_joints
from synthetic.room.layouts import ROOM
from synthetic.walking.collision_avoidance import MIN_DISTANCE, sidestep
from synthetic.walking.trajectory import Pose
from synthetic.walking.visiting_crowd import VisitingCrowd

RATE = 10  # samples a second


@pytest.fixture(scope="module")
def paths() -> np.ndarray:
    """Three minutes of four people: ``(T, 4, 2)`` meters."""
    walkers = VisitingCrowd(ROOM, 4, 7)
    return np.array([[(pose.x, pose.y) for pose in walkers.poses(t / RATE)] for t in range(180 * RATE)])


@cache
def four(seed: int) -> VisitingCrowd:
    """Return four people, computed once for all tests."""
    return VisitingCrowd(ROOM, 4, seed)


def inside(paths: np.ndarray) -> np.ndarray:
    return (paths[..., 0] < ROOM.width) & (paths[..., 1] < ROOM.depth)


def test_people_do_not_jump_while_visible(paths: np.ndarray) -> None:
    speed = np.hypot(*np.diff(paths, axis=0).transpose(2, 0, 1)) * RATE
    seen = inside(paths)[1:] | inside(paths)[:-1]
    assert speed[seen].max() < 2.5
    assert 0.6 < np.median(speed[seen]) < 1.4


def test_people_do_not_walk_through_furniture_or_walls(paths: np.ndarray) -> None:
    for west, south, east, north in ROOM.footprints():
        within = (paths > (west - 0.05, south - 0.05)) & (paths < (east + 0.05, north + 0.05))
        assert not within.all(axis=2).any()
    assert (paths[inside(paths)] > 0.2).all()
    wall = (np.abs(paths[..., 1] - ROOM.depth) < 0.2) & (paths[..., 0] < ROOM.width)
    (middle,) = (door.start + door.width / 2 for door in ROOM.doors if door.wall == "north")
    assert (np.abs(paths[..., 0] - middle)[wall] < 0.5).all()


def test_people_keep_their_distance_and_still_meet(paths: np.ndarray) -> None:
    apart = np.hypot(*(paths[:, :, None] - paths[:, None]).transpose(3, 0, 1, 2))
    pairs = apart[:, *np.triu_indices(4, 1)]
    both = (inside(paths)[:, :, None] & inside(paths)[:, None])[:, *np.triu_indices(4, 1)]
    assert np.mean(pairs[both] < 0.7) < 0.02
    assert np.mean(pairs[both] < 1.5) > 0.02


def test_people_leave_and_come_back(paths: np.ndarray) -> None:
    crossings = np.abs(np.diff(inside(paths).astype(int), axis=0)).sum(axis=0)
    assert (crossings >= 3).all()
    assert 0.5 < inside(paths).mean() < 0.95


@pytest.mark.parametrize("seed", range(4))
def test_a_background_can_be_learned_at_the_beginning(seed: int) -> None:
    """In the first four seconds all people are in the room, apart from each other, and moving."""
    start = [four(seed).poses(t / 10) for t in range(41)]
    assert all(ROOM.signed_distance_outside(pose.x, pose.y) < -0.5 for poses in start for pose in poses)
    assert min(pose.speed for poses in start for pose in poses) > 0.2
    first = np.array([(pose.x, pose.y) for pose in start[0]])
    apart = np.hypot(*(first[:, None] - first[None]).transpose(2, 0, 1))[np.triu_indices(4, 1)]
    assert apart.min() > 0.79  # KEEP, to a rounding
    assert apart.mean() > 2.0


@pytest.mark.parametrize("seed", range(3))
def test_the_room_is_hardly_ever_empty(seed: int) -> None:
    poses = [four(seed).poses(float(t)) for t in range(240)]
    present = [sum(ROOM.signed_distance_outside(pose.x, pose.y) < 0 for pose in people) for people in poses]
    assert np.mean(np.array(present) >= 2) > 0.95


def test_more_people_do_not_change_the_paths_of_the_first() -> None:
    few, many = VisitingCrowd(ROOM, 2, 3), VisitingCrowd(ROOM, 5, 3)
    for seconds in (0.0, 33.3, 250.0):
        assert many.poses(seconds)[:2] == few.poses(seconds)


def test_no_two_people_dress_alike() -> None:
    outfits = [choose_distinct_outfit(walker, 0) for walker in range(40)]
    assert len({(outfit.upper, outfit.lower) for outfit in outfits}) == len(outfits)


@pytest.mark.parametrize("part", ["upper", "lower"])
def test_the_first_eight_outfits_differ_clearly_in_every_piece(part: str) -> None:
    colors = np.array(
        [[getattr(choose_distinct_outfit(walker, 0), part) for walker in range(8)]], dtype=np.float32
    )
    lab = cv2.cvtColor(colors, cv2.COLOR_RGB2LAB)[0]
    apart = np.linalg.norm(lab[:, None] - lab[None], axis=2)[np.triu_indices(8, 1)]
    assert apart.min() > 30  # 2.3 is a just noticeable difference


@settings(deadline=None, max_examples=60)
@given(
    walked=st.floats(0, 1000),
    speed=st.floats(0, 1.6),
    heading=st.floats(-10, 10),
    height=st.floats(1.5, 2.0),
)
def test_a_body_stands_on_the_floor_at_its_height(
    walked: float, speed: float, heading: float, height: float
) -> None:
    body = place_joints(Pose(3.0, 2.0, heading, walked, speed), height)
    assert np.isfinite(body).all()
    assert (body[:, 2] > 0).all()
    assert body[[Joint.TOE_L, Joint.TOE_R], 2].min() < 0.06 * height
    assert 0.9 * height < body[Joint.HAIR, 2] + 0.061 * height < 1.01 * height
    assert np.hypot(*(body[:, :2] - (3.0, 2.0)).T).max() < 0.5 * height


def test_standing_feet_do_not_slide() -> None:
    """During a steady walk the lower foot hardly moves on the floor."""
    speed, step = 1.1, 0.01
    trail = [
        place_joints(Pose(speed * t * step, 0.0, 0.0, speed * t * step, speed), 1.75) for t in range(400)
    ]
    ankles = np.array([[body[Joint.ANKLE_L], body[Joint.ANKLE_R]] for body in trail])
    slide = np.abs(np.diff(ankles[..., 0], axis=0)) / step
    lower = ankles[:-1, :, 2].argmin(axis=1)
    assert np.median(slide[np.arange(len(lower)), lower]) < 0.1


@settings(deadline=None, max_examples=30)
@given(offsets=st.floats(-0.6, 0.6), speed=st.floats(0.4, 1.5))
def test_two_people_on_a_collision_course_step_aside(offsets: float, speed: float) -> None:
    clock = np.arange(40) / 5 - 4
    one = np.column_stack([4.5 + speed * clock, np.full(40, 3.5)])
    other = np.column_stack([4.5 - speed * clock, np.full(40, 3.5 + offsets)])
    adjusted = sidestep(ROOM, one, other[None], 5.0)
    before, after = (np.hypot(*(path - other).T).min() for path in (one, adjusted))
    assert after >= min(before, MIN_DISTANCE) - 1e-6
    assert np.abs(np.diff(adjusted, axis=0)).max() < 0.5  # meters in a fifth of a second


@settings(deadline=None, max_examples=60)
@given(
    index=st.integers(0, len(ROOM.furniture) - 1),
    origin=st.tuples(st.floats(0.3, 9.3), st.floats(0.3, 6.9), st.floats(2.5, 3.0)),
    seed=st.integers(0, 1000),
)
def test_a_ray_that_hits_furniture_ends_on_its_surface(
    index: int, origin: tuple[float, float, float], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    rays = rng.normal(size=(200, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    start = np.array(origin)
    for block in ROOM.furniture[index].blocks:
        distance, normal = hit_distances_and_normals(block, start, rays)
        found = distance < FAR
        assert (may_intersect(block, start, rays) | ~found).all()
        points = start + rays[found] * distance[found, None]
        assert (points > np.array(block.low) - 1e-6).all()
        assert (points < np.array(block.high) + 1e-6).all()
        assert ((normal[found] * rays[found]).sum(axis=1) < 1e-9).all()


def test_positions_and_presence_agree() -> None:
    scene = Scene("room", 1, 4, 0, 64, 36)
    for frame in range(0, 2000, 100):
        x, y = scene.ground_positions(frame).T
        assert np.array_equal(scene.inside(frame), (x <= scene.floor[0]) & (y <= scene.floor[1]))
