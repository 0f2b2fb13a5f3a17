"""Hypotheses of one frame: likelihoods against brute force, groups, and where a miss says something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.walked_floor import FloorNoise, detect_walkers, floor_views
from tracking.ground_plane import GroundSettings
from tracking.ground_plane.camera import BoxSizes
from tracking.ground_plane.gaussians import FusedPlaces, fuse, fuse_two, negative_log_densities
from tracking.ground_plane.places.agglomeration import agglomerate
from tracking.ground_plane.places.hypotheses import find_places, group_costs
from tracking.ground_plane.places.measurements import Measurements, covered_by_better, measure
from tracking.ground_plane.places.visibility import detection_probabilities

VIEWS = floor_views()
CAMERAS = [view.camera for view in VIEWS.values()]
SETTINGS = GroundSettings()
seeds = st.integers(0, 2**31 - 1)
few = settings(deadline=None, max_examples=25)


def measurements_of(places: list[list[float]], noise: FloorNoise, seed: int = 0) -> Measurements:
    found = detect_walkers(np.array([places]), VIEWS, noise, seed)[0]
    return measure(CAMERAS, list(found.values()), np.ones(3), SETTINGS)


@few
@given(seeds)
def test_the_cost_of_a_group_is_the_integral_over_its_place(seed: int) -> None:
    measurements = measurements_of([[4.0, 6.0]], FloorNoise(deviation=0.02), seed)
    group = tuple(range(len(measurements)))
    mean, covariance = fuse(measurements.places, measurements.covariances)
    fused = FusedPlaces.of(measurements.places, measurements.covariances, [group])
    assert fused.means[0] == pytest.approx(mean)
    assert fused.covariances[0] == pytest.approx(covariance)
    axis = np.arange(-2.0, 2.0, 0.02)
    grid = mean + np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    log_densities = sum(
        -negative_log_densities(grid - place, spread)
        for place, spread in zip(measurements.places, measurements.covariances, strict=True)
    )
    integral = np.log(np.exp(log_densities).sum() * 0.02**2)
    expected = -integral + measurements.log_clutter.sum() - len(group) * np.log(0.9)
    (cost,) = group_costs(measurements, np.ones((1, len(group)), dtype=np.bool_), fused, 0.9)
    assert cost == pytest.approx(expected, abs=0.02)


@few
@given(seeds)
def test_two_measurements_are_fused_like_any_number(seed: int) -> None:
    random = np.random.default_rng(seed)
    places, roots = random.normal(0.0, 3.0, (2, 2)), random.normal(0.0, 1.0, (2, 2, 2))
    covariances = roots @ roots.transpose(0, 2, 1) + 0.01 * np.eye(2)
    found = fuse_two((places[0], covariances[0]), (places[1], covariances[1]))
    for one, other in zip(found, fuse(places, covariances), strict=True):
        assert one == pytest.approx(other, rel=1e-9)


@few
@given(seeds)
def test_groups_have_one_detection_of_a_camera_at_most(seed: int) -> None:
    random = np.random.default_rng(seed)
    measurements = measurements_of(
        random.uniform(2.0, 8.0, (6, 2)).tolist(), FloorNoise(0.2, 0.02, 1.0), seed
    )
    for group in agglomerate(measurements, SETTINGS.people_density):
        cameras = measurements.camera[list(group)]
        assert len(set(cameras.tolist())) == len(group)


def test_people_far_apart_are_a_place_each() -> None:
    true = [[2.0, 3.0], [5.0, 5.0], [8.0, 3.0]]
    measurements = measurements_of(true, FloorNoise(deviation=0.005))
    sizes = [BoxSizes() for _ in CAMERAS]
    places = find_places(measurements, [], CAMERAS, sizes, SETTINGS, 1.0)
    best = sorted(range(len(places)), key=lambda k: places.costs[k])[:3]
    found = sorted(places.means[best].round(0).tolist())
    assert found == sorted(true)
    assert not places.conflicts[np.ix_(best, best)][~np.eye(3, dtype=bool)].any()


def test_a_miss_says_nothing_where_somebody_nearer_hides_the_person() -> None:
    camera = np.array([-4.0, -4.0])
    near = np.array([3.0, 3.0])
    behind = near + 1.5 * (near - camera) / np.linalg.norm(near - camera)
    measurements = measurements_of([near.tolist()], FloorNoise())
    sizes = [BoxSizes() for _ in CAMERAS]
    random = np.random.default_rng(0)
    for frame in detect_walkers(random.uniform(1.0, 9.0, (20, 4, 2)), VIEWS, FloorNoise()):
        for size, found in zip(sizes, frame.values(), strict=True):
            size.update(found.boxes)
    probabilities = detection_probabilities(
        np.array([behind, [7.0, 3.0]]),
        CAMERAS,
        sizes,
        measurements,
        np.zeros((2, len(measurements)), dtype=bool),
        0.9,
    )
    hidden, free = probabilities[:, 0]
    assert hidden < 0.3
    assert free == pytest.approx(0.9)
    assert probabilities[0, 2] == pytest.approx(0.9), "from the other side"


def test_a_camera_whose_lens_is_covered_is_not_expected_to_see_what_is_behind() -> None:
    sizes = [BoxSizes() for _ in CAMERAS]
    random = np.random.default_rng(0)
    for frame in detect_walkers(random.uniform(1.0, 9.0, (20, 4, 2)), VIEWS, FloorNoise()):
        for size, found in zip(sizes, frame.values(), strict=True):
            size.update(found.boxes)
    places = np.array([[7.0, 3.0], [3.0, 6.0]])
    behind, beside = sizes[0].boxes(CAMERAS[0].to_image(places))
    halves = np.array(
        [[*behind[:2], behind[2], behind[3] - 40.0], [*behind[:1], behind[3] - 40.0, *behind[2:]]]
    )
    covered = [replace(CAMERAS[0], covered=halves), *CAMERAS[1:]]
    nobody = measurements_of([], FloorNoise())
    found = detection_probabilities(places, covered, sizes, nobody, np.zeros((2, 0), dtype=bool), 0.9)
    assert found[0].tolist() == pytest.approx([0.0, 0.9, 0.9])
    assert found[1, 0] == pytest.approx(0.9), beside


def test_a_score_counts_for_less_within_a_better_box() -> None:
    whole, part, beside = [100, 100, 140, 220], [105, 105, 125, 150], [300, 100, 340, 220]
    boxes = np.array([whole, part, beside], dtype=np.float64)
    covers = covered_by_better(boxes, np.array([2.0, -0.5, 2.0]))
    assert covers[0] == covers[2] == 0.0
    assert covers[1] > 0.9
    assert covered_by_better(boxes, np.array([-0.5, 2.0, 2.0]))[1] < 0.1, "the part is the better one"


@few
@given(st.floats(0.5, 60.0))
def test_turns_are_as_frequent_at_any_frame_rate(fps: float) -> None:
    straight = (1.0 - SETTINGS.turn_probability(1.0 / fps)) ** fps
    assert straight == pytest.approx(1.0 - SETTINGS.turn_probability(1.0))
