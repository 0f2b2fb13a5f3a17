"""The background detector on drawn pictures: people are detected, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.drawn_people import HEIGHT, WIDTH, Figure, detect_all, picture
from tracking.boxes import iou
from tracking.detectors import AppearanceSettings, BackgroundDetector, BackgroundSettings
from tracking.detectors.background.height_model import (
    FloorGeometry,
    HeightModelEstimator,
    HeightModelSettings,
    fit_height_model,
    height_prior,
)
from tracking.detectors.background.isolated_people import IsolatedPerson, SampleNoveltyFilter
from tracking.types import Detections

SURE = 0.4
WALKER = Figure(10, 200, speed=2.0, begin=40)


def best_overlap(seen: Detections, figure: Figure, frame: int) -> float:
    """Return the best overlap of the figure with a confident detection."""
    sure = seen.boxes[seen.scores >= SURE]
    return float(iou(sure, figure.box(frame)).max(initial=0.0))


def test_a_walker_is_detected_in_a_tight_box() -> None:
    seen = detect_all(BackgroundDetector(), [WALKER], range(120))
    overlaps = [best_overlap(seen[frame], WALKER, frame) for frame in range(45, 120)]
    assert np.mean(np.array(overlaps) >= 0.5) >= 0.95
    # The height model is uncertain with one person, and a rectangle is not shaped like a person.
    assert np.mean(overlaps) >= 0.65


def test_an_empty_scene_has_no_detections() -> None:
    seen = detect_all(BackgroundDetector(), [], range(60))
    assert all((frame.scores < SURE).all() for frame in seen)


def test_two_people_side_by_side_are_two() -> None:
    pair = [Figure(60, 200, speed=1.5, begin=40), Figure(95, 215, speed=1.5, begin=40)]
    seen = detect_all(BackgroundDetector(), [*pair, Figure(300, 180, speed=-2.0, begin=40)], range(130))
    for figure in pair:
        found = [best_overlap(seen[frame], figure, frame) >= 0.5 for frame in range(90, 130)]
        assert np.mean(found) >= 0.8


def test_a_gain_change_causes_no_detections() -> None:
    detector = BackgroundDetector()
    detect_all(detector, [], range(50))
    brighter = detect_all(detector, [], range(50, 70), gain=1.15)
    assert all((frame.scores < SURE).all() for frame in brighter)


def test_people_are_found_in_the_dark_in_spite_of_the_noise() -> None:
    detector, random = BackgroundDetector(), np.random.default_rng(0)
    pale = Figure(10, 200, speed=2.0, begin=40, color=(80, 85, 100))
    detect_all(detector, [], range(50))
    seen = []
    for frame in range(50, 120):
        dark = picture([pale], frame, 0.3) + 8.0 * random.standard_normal((HEIGHT, WIDTH, 3))
        seen.append(detector.detect(np.clip(dark, 0, 255).astype(np.uint8)))
    found = [best_overlap(each, pale, frame) >= 0.5 for frame, each in enumerate(seen, 50)]
    assert np.mean(found[20:]) > 0.9


def test_a_standing_person_is_not_absorbed_into_the_background() -> None:
    arrived = [Figure(10, 200, speed=2.0, begin=40, end=100), Figure(210, 200, begin=100)]
    seen = detect_all(BackgroundDetector(), arrived, range(200))
    assert np.mean([best_overlap(seen[frame], arrived[1], frame) >= 0.5 for frame in range(110, 200)]) > 0.95


def test_a_person_in_the_first_frame_of_a_recording_is_detected_and_leaves_no_ghost() -> None:
    walker = Figure(10, 200, speed=2.0, begin=0)
    detector = BackgroundDetector()
    assert detector.warming_up
    detector.prepare([picture([walker], frame) for frame in range(0, 160, 20)], every_s=0.8)
    seen = detect_all(detector, [walker], range(100))
    assert not detector.warming_up
    assert np.mean([best_overlap(seen[frame], walker, frame) >= 0.5 for frame in range(100)]) >= 0.95
    left = [(seen[frame].scores >= SURE) & (seen[frame].boxes[:, 2] < 40.0) for frame in range(60, 100)]
    assert not any(ghosts.any() for ghosts in left)


def test_a_prepared_background_is_replaced_when_the_picture_changes() -> None:
    detector = BackgroundDetector()
    detector.prepare([picture([], frame) for frame in range(3)], every_s=0.04)
    upside_down = [np.ascontiguousarray(picture([], frame)[::-1]) for frame in range(120)]
    seen = [detector.detect(image) for image in upside_down]
    assert (seen[-1].scores < SURE).all()


def test_the_ghost_of_a_person_present_from_the_start_vanishes() -> None:
    leaves = Figure(150, 200, end=60)
    detector = BackgroundDetector()
    detect_all(detector, [leaves], range(60))
    after = detect_all(detector, [], range(60, 130))
    assert best_overlap(after[0], leaves, 0) >= 0.5, "without a ghost the test proves nothing"
    assert all((frame.scores < SURE).all() for frame in after[-20:])


def test_ignored_regions_have_no_detections() -> None:
    right = ((WIDTH / 2, 0.0), (WIDTH, 0.0), (WIDTH, HEIGHT), (WIDTH / 2, HEIGHT))
    hidden = Figure(260, 200, speed=-0.5, begin=40)
    seen = detect_all(BackgroundDetector(BackgroundSettings(ignore=(right,))), [hidden], range(100))
    assert all((frame.scores < SURE).all() for frame in seen)


def test_what_is_covered_is_nobody_and_neither_hides_the_rest_nor_is_learned() -> None:
    covered = np.array([[WIDTH / 2 + 20, 0.0, WIDTH, HEIGHT]])
    walker = Figure(10, 200, speed=1.5, begin=40)
    detector = BackgroundDetector()
    detector.prepare([picture([], frame) for frame in range(3)], every_s=0.04)

    def seen(frame: int, *, painted: bool) -> Detections:
        image = picture([walker], frame)
        if painted:
            image[:, WIDTH // 2 + 20 :] = (40, 60, 150)
        return detector.detect(image)

    for frame in range(40):
        seen(frame, painted=False)
    detector.cover(covered)
    behind = [seen(frame, painted=True) for frame in range(40, 120)]
    assert (
        np.mean([best_overlap(found, walker, 40 + at) >= 0.5 for at, found in enumerate(behind[10:], 10)])
        > 0.9
    )
    assert not any((found.boxes[found.scores >= SURE][:, 0] > WIDTH / 2).any() for found in behind)
    detector.cover(np.empty((0, 4)))
    after = [seen(frame, painted=False) for frame in range(120, 130)]
    assert all(len(found.boxes[found.scores >= SURE]) == 1 for found in after)


@pytest.mark.parametrize(("color", "length"), [(True, 96), (False, 64)])
def test_color_histograms_distinguish_people(color: bool, length: int) -> None:
    red, blue = Figure(40, 200, 1.0, 40), Figure(250, 200, -1.0, 40, color=(190, 110, 35))
    detector = BackgroundDetector(BackgroundSettings(appearance=AppearanceSettings(color=color)))
    seen = detect_all(detector, [red, blue], range(80))[-1]
    assert detector.appearance_bins == length == seen.histograms.shape[1]
    np.testing.assert_allclose(seen.histograms.sum(axis=1), 1.0)
    histograms = [seen.histograms[np.argmax(iou(seen.boxes, figure.box(79)))] for figure in (red, blue)]
    similarity = np.sqrt(histograms[0] * histograms[1]).sum()
    assert (similarity < 0.85) == color


def test_the_same_frames_give_identical_detections() -> None:
    first, second = (detect_all(BackgroundDetector(), [WALKER], range(80)) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        for part in ("boxes", "scores", "histograms"):
            assert getattr(one, part).tobytes() == getattr(other, part).tobytes()


def test_another_size_or_type_is_refused() -> None:
    detector = BackgroundDetector()
    detector.detect(picture([], 0))
    with pytest.raises(ValueError, match="size changed"):
        detector.detect(picture([], 1)[:-2])
    with pytest.raises(ValueError, match="uint8"):
        detector.detect(picture([], 1)[..., 0])


def test_a_third_of_outliers_does_not_change_the_height_model() -> None:
    rng = np.random.default_rng(1)
    foot = rng.uniform(100, 280, 300)
    height = (0.6 * foot - 20.0) * rng.normal(1.0, 0.05, 300)
    height[::3] *= 1.6
    line = fit_height_model(np.stack([foot, height], axis=1), HeightModelSettings())
    assert line is not None
    np.testing.assert_allclose(
        line.expected_height(np.array([120.0, 200.0, 280.0])), [52.0, 100.0, 148.0], rtol=0.06
    )


def test_the_height_model_is_uncertain_where_it_has_no_samples() -> None:
    foot = np.linspace(150, 170, 20)
    line = fit_height_model(np.stack([foot, 0.6 * foot - 20.0], axis=1), HeightModelSettings())
    assert line is not None
    near, far = line.height_standard_deviation(np.array([160.0, 280.0]))
    assert far > 2.0 * near


def test_heights_that_do_not_grow_towards_the_camera_are_refused() -> None:
    foot = np.linspace(60, 280, 400)
    steep = np.stack([foot, 200.0 - 0.5 * foot], axis=1)
    assert fit_height_model(steep, HeightModelSettings()) is None


@settings(deadline=None, max_examples=40)
@given(st.floats(0.35, 1.0), st.floats(-80.0, 60.0), st.integers(0, 1000))
def test_with_floor_geometry_fragments_and_pairs_of_people_do_not_change_the_height_model(
    slope: float, row: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    foot = rng.uniform(190, 220, 60)
    height = slope * (foot - row) * rng.normal(1.0, 0.04, 60)
    height[:24] *= rng.uniform(0.2, 0.6, 24)
    height[24:32] *= rng.uniform(1.2, 1.5, 8)
    prior = height_prior(HeightModelSettings(), FloorGeometry(row, slope), HEIGHT)
    line = fit_height_model(np.stack([foot, height], axis=1), HeightModelSettings(), prior)
    assert line is not None
    rows = np.array([130.0, 200.0, 270.0])
    np.testing.assert_allclose(line.expected_height(rows), slope * (rows - row), rtol=0.08)


def test_with_floor_geometry_there_is_a_height_model_without_or_with_inconsistent_samples() -> None:
    floor = FloorGeometry(20.0, 0.65)
    before = HeightModelEstimator(HeightModelSettings(), floor=floor, rows=HEIGHT).model
    assert before is not None
    assert before.expected_height(np.array([20.0, 120.0])).tolist() == [0.0, 65.0]
    assert HeightModelEstimator(HeightModelSettings()).model is None
    rng = np.random.default_rng(3)
    wild = np.stack([rng.uniform(100, 280, 200), rng.uniform(20, 250, 200)], axis=1)
    assert (
        fit_height_model(wild, HeightModelSettings(), height_prior(HeightModelSettings(), floor, HEIGHT))
        == before
    )
    assert fit_height_model(wild, HeightModelSettings()) is None


def test_many_small_people_lower_the_height_model() -> None:
    rng = np.random.default_rng(5)
    foot = rng.uniform(100, 280, 300)
    height = 0.8 * 0.6 * (foot - 30.0) * rng.normal(1.0, 0.05, 300)
    prior = height_prior(HeightModelSettings(), FloorGeometry(30.0, 0.6), HEIGHT)
    samples = np.stack([foot, height], axis=1)
    line = fit_height_model(samples, HeightModelSettings(), prior, distinct_people=8)
    assert line is not None
    np.testing.assert_allclose(line.expected_height(np.array([120.0, 200.0])), [43.2, 81.6], rtol=0.08)
    one = fit_height_model(samples, HeightModelSettings(), prior, distinct_people=1)
    assert one is not None
    assert line.expected_height(np.array([200.0])) < one.expected_height(np.array([200.0])) < 102.0, (
        "one small person may be a child"
    )


def test_the_height_model_is_more_uncertain_with_fewer_people() -> None:
    foot = np.linspace(100, 280, 900)
    samples = np.stack([foot, 0.65 * foot - 20.0], axis=1)
    lines = [fit_height_model(samples, HeightModelSettings(), distinct_people=people) for people in (1, 2, 8)]
    deviations = [
        float(line.height_standard_deviation(np.array([200.0]))[0]) for line in lines if line is not None
    ]
    assert len(deviations) == 3
    assert deviations[0] > 1.3 * deviations[1] > 1.6 * deviations[2]
    assert deviations[0] >= 0.03 * 110.0, "many samples of one tall person do not help"


def test_a_standing_person_gives_one_sample_and_a_walking_one_gives_many() -> None:
    novelty, counted = SampleNoveltyFilter(), {"stands": 0, "walks": 0}
    for frame in range(400):
        stands = IsolatedPerson(60.0 + frame % 3, 130.0, 50.0)
        walks = IsolatedPerson(80.0 + 2.0 * frame, 200.0, 100.0)
        flickers = [] if 100 <= frame < 140 else [stands]
        for person in novelty.new_samples([*flickers, walks], 0.04):
            counted["walks" if person is walks else "stands"] += 1
    assert counted["stands"] == 1
    assert 60 <= counted["walks"] <= 80


def test_a_place_is_forgotten_when_it_is_empty() -> None:
    novelty, person = SampleNoveltyFilter(), IsolatedPerson(60.0, 130.0, 50.0)
    assert novelty.new_samples([person], 0.04) == [person]
    assert novelty.new_samples([], 8.0) == []
    assert novelty.new_samples([person], 0.04) == [person]


def test_a_standing_person_with_hidden_feet_does_not_change_the_height_model() -> None:
    visible = np.full((HEIGHT, WIDTH), 255, dtype=np.uint8)
    learner = HeightModelEstimator(HeightModelSettings())
    for frame in range(600):
        foreground = np.zeros_like(visible)
        foreground[85:125, 280:296] = 255  # three quarters of a person
        if frame < 200:
            foot = 140 + frame // 2
            tall = round(0.6 * foot - 25)
            left = 20 + frame
            foreground[foot - tall : foot, left : left + round(0.36 * tall)] = 255
        learner.observe(foreground, visible)
    assert learner.model is not None
    rows = np.array([125.0, 180.0, 235.0])
    np.testing.assert_allclose(learner.model.expected_height(rows), 0.6 * rows - 25.0, rtol=0.08)


def test_without_a_unit_the_horizon_constrains_the_height_model() -> None:
    rng = np.random.default_rng(8)
    foot = rng.uniform(120, 150, 60)
    height = 0.8 * (foot - 20.0) * rng.normal(1.0, 0.04, 60)
    height[:20] *= 0.7
    prior = height_prior(HeightModelSettings(), FloorGeometry(20.0, None), HEIGHT)
    assert prior.model is None
    samples = np.stack([foot, height], axis=1)
    held, free = (
        fit_height_model(samples, HeightModelSettings(), model_prior, distinct_people=4)
        for model_prior in (prior, None)
    )
    assert held is not None
    assert free is not None
    near = np.array([260.0])
    np.testing.assert_allclose(held.expected_height(near), [192.0], rtol=0.08)
    assert held.height_standard_deviation(near) < 0.5 * free.height_standard_deviation(near)


def test_more_fragments_than_people_do_not_change_the_height_model() -> None:
    rng = np.random.default_rng(6)
    foot = rng.uniform(110, 260, 200)
    height = (0.6 * foot - 20.0) * rng.normal(1.0, 0.04, 200)
    height[:120] *= rng.choice([0.3, 0.4], 120)
    line = fit_height_model(np.stack([foot, height], axis=1), HeightModelSettings())
    assert line is not None
    np.testing.assert_allclose(
        line.expected_height(np.array([120.0, 200.0, 260.0])), [52.0, 100.0, 136.0], rtol=0.08
    )


def test_the_height_model_is_reliable_with_floor_geometry_or_many_samples() -> None:
    alone = HeightModelEstimator(HeightModelSettings())
    assert not alone.is_reliable
    assert HeightModelEstimator(
        HeightModelSettings(), floor=FloorGeometry(57.0, 0.7), rows=HEIGHT
    ).is_reliable
    visible = np.full((HEIGHT, WIDTH), 255, dtype=np.uint8)
    reliable = []
    for step in range(120):
        foreground = np.zeros_like(visible)
        foot = 120 + step
        tall = int(0.7 * foot - 40)
        left = 20 + 2 * step
        foreground[foot - tall : foot, left : left + int(0.36 * tall)] = 255
        alone.observe(foreground, visible)
        reliable.append(alone.is_reliable)
    assert not reliable[5]
    assert reliable[-1]


def test_floor_geometry_gives_the_height_model_at_every_picture_size() -> None:
    lines = []
    for factor in (1, 2):
        detector = BackgroundDetector(floor=FloorGeometry(57.0 * factor, 0.7))
        assert detector.height_model is None
        detector.detect(np.zeros((factor * HEIGHT, factor * WIDTH, 3), dtype=np.uint8))
        lines.append(detector.height_model)
    assert lines[0] == lines[1] == height_prior(HeightModelSettings(), FloorGeometry(57.0, 0.7), HEIGHT).model
