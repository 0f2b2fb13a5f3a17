"""The fish scene: identical fish swim freely, occlude each other, and ground truth has the visible shares."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from itertools import pairwise

import cv2
import numpy as np
import pytest

from synthetic import Scene
from synthetic.cameras.pinhole import PinholeCamera
from synthetic.drawing.figure import Figure
from synthetic.ground_truth import FigureLayer, measure_visibility
from synthetic.tank import VIEWPOINTS
from synthetic.tank.fish import LENGTH, draw_fish, fish_vertices
from synthetic.tank.shoal import ROUND, Shoal, ShoalState
from synthetic.tank.water import attenuate_by_water, caustics, open_water

SIZE = (320, 180)
RATE = 10  # samples a second


def tank(cameras: int = 2, objects: int | None = None, seed: int = 1) -> Scene:
    return Scene("fish", cameras, objects, seed, *SIZE)


@pytest.fixture(scope="module", params=range(3))
def states(request: pytest.FixtureRequest) -> list[ShoalState]:
    """Return seventy seconds of nine fish: two rounds, and the start of a third."""
    shoal = Shoal(9, request.param)
    return [shoal.at(t / RATE) for t in range(70 * RATE)]


def test_fish_never_swim_into_each_other(states: list[ShoalState]) -> None:
    along = np.linspace(-0.45, 0.45, 7) * LENGTH
    for state in states:
        spines = state.places[:, None] + along[:, None] * state.ahead[:, None]
        gaps = np.linalg.norm(spines[:, None, :, None] - spines[None, :, None], axis=4).min(axis=(2, 3))
        assert gaps[np.triu_indices(9, 1)].min() > 0.15  # meters: bodies are 0.14 broad


def test_fish_swim_forward_and_turn_plausibly(states: list[ShoalState]) -> None:
    turns, slants = [], []
    for one, other in pairwise(states):
        step = other.places - one.places
        far = np.linalg.norm(step, axis=1)
        assert far.max() * RATE < 1.6
        turns.append(np.arccos(np.clip((one.ahead * other.ahead).sum(axis=1), -1, 1)))
        slants.append((step * one.ahead).sum(axis=1) / np.maximum(far, 1e-9))
    assert np.degrees(np.max(turns)) < 30  # in a tenth of a second
    assert np.median(slants) > 0.99
    assert np.mean(np.array(slants) > 0.8) > 0.98


def test_rounds_of_the_shoal_join_without_a_jump() -> None:
    shoal = Shoal(9, 4)
    for number in (1, 2, 3):
        before, after = shoal.at(number * ROUND - 1e-4), shoal.at(number * ROUND)
        assert np.abs(before.places - after.places).max() < 1e-3
        assert (before.ahead * after.ahead).sum(axis=1).min() > 0.999
        tails = before.beats - after.beats
        assert np.abs(tails - np.rint(tails)).max() < 0.01


def test_fish_stay_in_the_first_cameras_picture(states: list[ShoalState]) -> None:
    view = PinholeCamera.at(VIEWPOINTS[0], *SIZE)
    outside = 0
    for state in states[::5]:
        pixels, _ = view.project(fish_vertices(state).reshape(-1, 3))
        beyond = ((pixels < 0) | (pixels > SIZE)).any(axis=1).reshape(9, -1).any(axis=1)
        outside += int(beyond.sum())
    assert outside < 0.01 * 9 * len(states[::5])


def test_all_begin_on_a_circle_and_swim_towards_the_camera() -> None:
    first = Shoal(9, 3).at(0.0)
    assert np.allclose(first.ahead, (0.0, -1.0, 0.0))
    assert np.ptp(first.places[:, 1]) < 1e-9
    truth, _ = tank(seed=3).truth(0)
    size = truth.boxes[:, 2:] - truth.boxes[:, :2]
    assert np.ptp(size[:, 0]) < 0.35 * size[:, 0].mean()
    assert np.ptp(truth.distances) < 0.3


@pytest.mark.parametrize("seed", range(4))
def test_fish_occlude_each_other_in_every_clip_of_twenty_seconds(seed: int) -> None:
    scene = tank(1, seed=seed)
    shares = []
    for frame in range(0, 500, 10):
        (truth,) = scene.truth(frame)
        assert truth.ids.tolist() == list(range(1, 10))
        shares.append(truth.visibility)
    assert np.mean(np.array(shares) < 0.9) > 0.05
    assert np.mean(np.array(shares) < 0.5) > 0.005
    assert np.mean(np.array(shares) > 0.97) > 0.5


def test_a_frame_is_identical_in_every_order_and_process() -> None:
    scene = tank()
    frames = [0, 3000, 17, 200_000]
    forward = [scene.image(camera, frame) for camera in range(2) for frame in frames]
    again = tank()
    backward = [again.image(camera, frame) for camera in (1, 0) for frame in reversed(frames)][::-1]
    assert all(np.array_equal(one, other) for one, other in zip(forward, backward, strict=True))
    script = (
        "import hashlib; from synthetic import Scene;"
        f"picture = Scene('fish', 2, None, 1, {SIZE[0]}, {SIZE[1]}).image(1, 3000);"
        "print(hashlib.sha256(picture.tobytes()).hexdigest())"
    )
    process = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    assert process.stdout.strip() == hashlib.sha256(forward[5].tobytes()).hexdigest()


def test_a_box_is_where_the_picture_differs_from_the_tank_without_fish() -> None:
    scene = tank(2, 1, seed=2)
    found = []
    for frame in range(40, 1500, 60):
        for camera, truth in enumerate(scene.truth(frame)):
            if len(truth.ids) == 0 or truth.visibility[0] < 0.99:
                continue
            empty = scene.world.background(camera, frame / 25).astype(np.int16)
            changed = np.abs(scene.world.picture(camera, frame / 25).astype(np.int16) - empty).max(axis=2) > 6
            x, y, width, height = cv2.boundingRect(changed.astype(np.uint8))
            found.append(np.abs(truth.boxes[0] - (x, y, x + width, y + height)).max())
    assert len(found) > 20
    assert np.mean(found) < 1.5
    assert max(found) < 5  # pixels: a fin's tip through the murk


def test_of_two_fish_in_line_the_farther_one_is_occluded() -> None:
    view = PinholeCamera.at(VIEWPOINTS[0], *SIZE)
    shares = []
    for offsets in (2.0, 0.25, 0.0):
        places = np.array([[3.0 + offsets, 3.6, 1.4], [3.0, 1.0, 1.42]])
        side = np.tile([1.0, 0.0, 0.0], (2, 1))
        two = ShoalState(places, side, np.zeros(2), np.ones(2), np.zeros(2))
        further, depth_offset = draw_fish(view, fish_vertices(two), caustics(0.0))
        assert further is not None
        assert depth_offset is not None
        measured = measure_visibility(
            view, [FigureLayer(0, further, None), FigureLayer(1, depth_offset, None)]
        )
        assert measured[1].share == 1.0
        shares.append(measured[0].share)
    assert shares[0] == 1.0
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] < 0.1


def test_an_occluder_lowers_visibility_and_has_no_truth_row() -> None:
    view = PinholeCamera.at(VIEWPOINTS[0], 100, 60)
    block = np.full((20, 40, 4), 255, dtype=np.uint8)
    measured = measure_visibility(
        view, [FigureLayer(3, Figure(10, 10, block), None), FigureLayer(None, Figure(20, 0, block), None)]
    )
    assert list(measured) == [3]
    assert measured[3].box.tolist() == [10, 10, 50, 30]
    assert measured[3].share == pytest.approx(1 - 30 * 10 / (40 * 20))


def test_murk_shifts_colors_to_that_of_the_water_and_red_first() -> None:
    water = open_water(np.array([[0.0, 1.0, 0.0]]))
    attenuated = attenuate_by_water(np.ones((4, 3)), np.array([0.0, 4.0, 12.0, 200.0]), water)
    assert np.allclose(attenuated[0], 1.0)
    assert np.allclose(attenuated[3], water, atol=1e-4)
    remaining = (attenuated - water) / (1 - water)
    assert (np.diff(remaining, axis=0) < 0).all()
    assert (remaining[1:3, 0] < remaining[1:3, 1]).all()


def test_caustics_move_tile_and_have_bright_lines() -> None:
    now, soon, later = (caustics(seconds).astype(int) for seconds in (5.0, 5.04, 7.0))
    assert 0 < np.abs(soon - now).mean() < 8  # no flicker
    assert np.abs(later - now).mean() > 15
    assert now.max() > 180
    assert np.median(now) < 70
    seam = np.abs(now[:, 0] - now[:, -1]).mean()
    inner = np.abs(np.diff(now, axis=1)).mean()
    assert seam < 2.5 * inner


def test_fish_have_no_floor() -> None:
    scene = tank()
    assert scene.objects == 9
    assert scene.homography(0) is None
    assert scene.ground_positions(10).shape == (9, 2)
    assert scene.inside(10).all()
