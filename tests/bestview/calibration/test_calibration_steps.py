"""The steps of calibration from walks, compared with simple references."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import foot_covariance, to_ground
from bestview.calibration import Walk, WalkSettings, WalkTrack, build_walk
from bestview.calibration.bundle_adjustment import CameraRig, Correspondences, offset_standard_errors
from bestview.calibration.floor_agreement import (
    mutual_matches,
    project_to_floor,
    total_agreement,
    track_pair_agreement,
    whitened_differences,
)
from bestview.calibration.pair_hypotheses import propose_relative_poses
from bestview.calibration.pair_search import walk_breadth
from bestview.calibration.pinhole import Pinhole
from bestview.calibration.samples import candidate_matches, sample_walk
from bestview.calibration.walk_tracks import halves_swapped, time_reversed
from bestview.geometry.ground_plane import foot_points
from fakes.bestview.walkers import SIZE, Noise, camera_at, random_path, recorded_walk

seeds = st.integers(0, 10_000).map(np.random.default_rng)
SETTINGS = WalkSettings.at_rate(25.0)


def any_camera(random: np.random.Generator) -> Pinhole:
    camera = camera_at(*random.uniform(-5, -3, 2), focal=random.uniform(0.5, 1.5))
    camera.parameters[:4] += random.normal(0, 0.05, 4)
    return camera


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_the_pinhole_floor_agrees_with_its_homography(random: np.random.Generator) -> None:
    camera, place = any_camera(random), random.uniform(-1, 1, (20, 2))
    image = camera.picture(place)
    assert np.allclose(camera.floor(image), place)
    assert np.allclose(to_ground(camera.floor_homography(2.0), image), 2.0 * place)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_a_person_has_height_one(random: np.random.Generator) -> None:
    camera, place = any_camera(random), random.uniform(-1, 1, (20, 2))
    lens = camera._projection()
    head = np.column_stack([place, np.ones((20, 2))]) @ lens.T
    image = camera.picture(place)
    assert np.allclose(camera.heights(image), image[:, 1] - head[:, 1] / head[:, 2])


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_foot_covariance_agrees_with_the_ground_planes(random: np.random.Generator) -> None:
    camera, place = any_camera(random), random.uniform(-1, 1, (10, 2))
    image, tall = camera.picture(place), random.uniform(20, 90, 10)
    boxes = np.column_stack([image[:, 0] - 5, image[:, 1] - tall, image[:, 0] + 5, image[:, 1]])
    assert np.allclose(foot_points(boxes), image)
    spread = project_to_floor(camera, image, tall, SETTINGS).covariance
    same = foot_covariance(camera.floor_homography(), boxes, SETTINGS.foot_sideways, SETTINGS.foot_upwards)
    assert np.allclose(spread, np.stack([same[:, 0, 0], same[:, 0, 1], same[:, 1, 1]], axis=1))


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_whitened_distances_are_mahalanobis_distances(random: np.random.Generator) -> None:
    place, tall = random.uniform(-1, 1, (8, 2)), random.uniform(20, 90, 8)
    one, other = any_camera(random), any_camera(random)
    here = project_to_floor(one, one.picture(place), tall, SETTINGS)
    there = project_to_floor(other, other.picture(place + random.normal(0, 0.2, (8, 2))), tall, SETTINGS)
    off = whitened_differences(here, there, SETTINGS)
    for index in range(8):
        ee, en, nn = here.covariance[index] + there.covariance[index]
        covariance = np.array([[ee, en], [en, nn]]) + SETTINGS.foot_floor**2 * np.eye(2)
        away = here.position[index] - there.position[index]
        assert off[index] @ off[index] == pytest.approx(away @ np.linalg.solve(covariance, away))


def tracks(random: np.random.Generator, count: int) -> tuple[WalkTrack, ...]:
    return tuple(
        WalkTrack(
            int(random.integers(0, 40)),
            random.uniform(10, 200, (int(random.integers(2, 50)), 4)).cumsum(axis=1),
        )
        for _ in range(count)
    )


@settings(deadline=None, max_examples=30)
@given(seeds, st.floats(-20, 20))
def test_candidate_matches_pair_samples_of_the_same_pulse(random: np.random.Generator, offset: float) -> None:
    one, other = (Walk(name, SIZE, tracks(random, 3)) for name in "ab")
    pulses = np.arange(-20.0, 120.0, 4.0)
    here = sample_walk(one, pulses, 0.0, 2, 0.15)
    there = sample_walk(other, pulses, offset, 2, 0.15)
    candidates = candidate_matches(here, there)
    expected = {
        (a, b)
        for a in range(len(here.times))
        for b in range(len(there.times))
        if here.times[a] == there.times[b]
    }
    assert set(zip(candidates.here.tolist(), candidates.there.tolist(), strict=True)) == expected
    for index in range(len(candidates.here)):
        pair = (here.track[candidates.here[index]], there.track[candidates.there[index]])
        assert tuple(candidates.tracks[candidates.track_pair[index]]) == pair


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_boxes_are_interpolated_between_frames(random: np.random.Generator) -> None:
    (track,) = tracks(random, 1)
    times = random.uniform(track.first_frame - 3, track.end_frame + 3, 30)
    frames = np.arange(track.first_frame, track.end_frame)
    for time, box in zip(times, track.at(times), strict=True):
        if frames[0] <= time <= frames[-1]:
            assert np.allclose(box, [np.interp(time, frames, side) for side in track.boxes.T])
        else:
            assert np.isnan(box).all()


@settings(deadline=None, max_examples=20)
@given(seeds, st.floats(-3, 3), st.floats(-5, 5))
def test_two_curves_of_one_person_give_the_relative_pose(
    random: np.random.Generator, turn: float, east: float
) -> None:
    camera, path = camera_at(-4, -1), random_path(random, 300)
    image, tall = camera.picture(path), camera.heights(camera.picture(path))
    track = WalkTrack(0, np.column_stack([image[:, 0] - 5, image[:, 1] - tall, image[:, 0] + 5, image[:, 1]]))
    samples = sample_walk(Walk("a", SIZE, (track,)), np.arange(0.0, 300.0, 5.0), 0.0, 5, 0.15)
    here = project_to_floor(camera, samples.feet, samples.tall, SETTINGS)
    there = here.transformed(turn, np.array([east, 2.0]))
    (best, *_) = propose_relative_poses([here], [there], candidate_matches(samples, samples), 5)
    assert np.exp(1j * best.rotation) == pytest.approx(np.exp(1j * turn))
    assert best.translation == pytest.approx([east, 2.0])


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_matches_are_one_to_one_at_each_pulse_and_near(random: np.random.Generator) -> None:
    one, other = (Walk(name, SIZE, tracks(random, 4)) for name in "ab")
    pulses = np.arange(0.0, 90.0, 3.0)
    here, there = (sample_walk(walk, pulses, 0.0, 3, 0.15) for walk in (one, other))
    candidates = candidate_matches(here, there)
    off = random.normal(0, 1.0, (len(candidates.here), 2))
    pair_agreement = track_pair_agreement(off, candidates, 2.0)
    for pair in range(len(candidates.tracks)):
        own_rows = candidates.track_pair == pair
        counted = np.clip(1 - (off[own_rows] ** 2).sum(axis=1) / 4, -1, 1) * candidates.weight[own_rows]
        assert pair_agreement[pair] == pytest.approx(counted.sum())
    chosen = mutual_matches(off, pair_agreement, here, there, candidates, 2.0)
    assert len(set(candidates.here[chosen])) == len(set(candidates.there[chosen])) == len(chosen)
    assert (np.hypot(*off[chosen].T) < 2.0).all()
    assert total_agreement(pair_agreement, candidates) <= np.maximum(pair_agreement, 0).sum() + 1e-9


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_reversed_and_swapped_walks_hold_the_same_boxes(random: np.random.Generator) -> None:
    walk = Walk("a", SIZE, tracks(random, 4))
    count = sum(len(track.boxes) for track in walk.tracks)
    assert sum(len(track.boxes) for track in time_reversed(walk).tracks) == count
    assert (
        count - 2 * len(walk.tracks)
        <= sum(len(track.boxes) for track in halves_swapped(walk).tracks)
        <= count
    )
    for wrong in (time_reversed(walk), halves_swapped(walk)):
        assert all(track.first_frame >= 0 for track in wrong.tracks)
        assert wrong.end_frame <= walk.end_frame


def test_truncated_boxes_are_dropped_and_long_gaps_split_a_track() -> None:
    box = [100.0, 100.0, 140.0, 200.0]
    frames = [*range(20), *range(40, 60)]
    boxes = np.array([box] * 40)
    boxes[5] = [100.0, 260.0, 140.0, 360.0]  # at the lower edge
    walk = build_walk("a", SIZE, frames, [1] * 40, boxes, 25.0)
    assert [(track.first_frame, track.end_frame) for track in walk.tracks] == [(0, 20), (40, 60)]
    assert np.allclose(walk.tracks[0].boxes[5], box)  # interpolated
    assert build_walk("a", SIZE, [0, 1], [1, 1], np.array([[0.0, 10, 40, 90]] * 2), 25.0).tracks == ()


@pytest.mark.parametrize(("fps", "step"), [(2.0, 1), (5.0, 1), (25.0, 5), (60.0, 12)])
@settings(deadline=None, max_examples=20)
@given(random=seeds)
def test_a_walk_of_another_rate_is_averaged_over_the_same_time(
    fps: float, step: int, random: np.random.Generator
) -> None:
    assert WalkSettings.at_rate(fps) == WalkSettings(round(3 * fps), step)
    boxes = np.array([100.0, 80, 140, 200]) + random.uniform(-9, 9, (30, 4))
    (track,) = build_walk("a", SIZE, range(30), [1] * 30, boxes, fps).tracks
    half = step // 2
    middle = [boxes[at - half : at + half + 1].mean(axis=0) for at in range(half, 30 - half)]
    assert np.allclose(track.boxes[half : 30 - half], middle)
    with_gaps = build_walk(
        "a", SIZE, [0, 1, 1 + step, 2 + step, 3 + 2 * step, 4 + 2 * step], [1] * 6, boxes[:6], fps
    )
    assert [track.first_frame for track in with_gaps.tracks] == [0, 3 + 2 * step]


def test_a_line_has_no_breadth() -> None:
    along = np.linspace(0, 9, 50)
    assert walk_breadth(np.column_stack([along, 2 * along]), np.ones(50)) == pytest.approx(0.0, abs=1e-9)
    assert walk_breadth(np.empty((0, 2)), np.empty(0)) == 0.0
    square = np.random.default_rng(0).uniform(-1, 1, (4000, 2))
    assert walk_breadth(square, np.ones(4000)) == pytest.approx(1 / np.sqrt(3), rel=0.05)


def test_the_offset_error_grows_with_the_noise() -> None:
    errors = []
    for noise in (0.005, 0.05):
        random = np.random.default_rng(3)
        cameras, path = (camera_at(-4, -1), camera_at(1, -4.5)), random_path(np.random.default_rng(3), 500)
        views = [recorded_walk("c", camera, [path], random, noise=Noise(noise, noise)) for camera in cameras]
        samples = [sample_walk(view, np.arange(0.0, 500.0, 5.0), 0.0, 5, 0.15) for view in views]
        candidates = candidate_matches(*samples)
        matches = Correspondences(0, 1, candidates.here, candidates.there, candidates.weight)
        first, second = offset_standard_errors(CameraRig(cameras, np.zeros(2)), samples, [matches], SETTINGS)
        assert first == 0.0
        errors.append(second)
    assert 0.0 < 3 * errors[0] < errors[1] < 2.0
