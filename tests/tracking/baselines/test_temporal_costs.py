"""Costs of steps between blobs and the comparison of colors equal the formulas of the report."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracking.baselines.temporal_consistency import BlobSettings, TemporalSettings
from tracking.baselines.temporal_consistency.blobs import Blob, BlobDetector, YuvBackground
from tracking.baselines.temporal_consistency.distance import (
    blob_gap,
    distance_cost,
    distance_costs,
    stepped_distance_m,
)
from tracking.baselines.temporal_consistency.regional_appearance import (
    BINS,
    RegionalAppearance,
    mismatch,
    uv_histogram,
)

PIXELS_PER_METER = 50.0
SETTINGS = TemporalSettings()


def _blob(left: float, top: float, right: float, bottom: float, shape: np.ndarray | None = None) -> Blob:
    filled = np.full((int(bottom - top), int(right - left)), 255, dtype=np.uint8)
    shape = filled if shape is None else shape
    return Blob(np.array([left, top, right, bottom]), shape, int((shape > 0).sum()), np.full(BINS, 1 / BINS))


def test_a_blob_within_another_has_distance_zero() -> None:
    outer, inner = _blob(0, 0, 40, 40), _blob(10, 10, 30, 40)
    assert stepped_distance_m(outer, inner, PIXELS_PER_METER, SETTINGS) == 0.0
    assert stepped_distance_m(inner, outer, PIXELS_PER_METER, SETTINGS) == 0.0


def test_blobs_that_overlap_in_part_are_six_centimeters_apart() -> None:
    assert stepped_distance_m(_blob(0, 0, 40, 40), _blob(20, 20, 60, 60), PIXELS_PER_METER, SETTINGS) == 0.06


def test_blobs_apart_have_the_gap_between_their_edges_and_sixteen_centimeters() -> None:
    left, right = _blob(0, 0, 20, 20), _blob(70, 0, 100, 20)
    assert blob_gap(left, right) == pytest.approx(50.0, abs=1.5)
    assert stepped_distance_m(left, right, PIXELS_PER_METER, SETTINGS) == pytest.approx(0.16 + 1.0, abs=0.03)


def test_the_gap_is_measured_between_shapes_and_not_between_boxes() -> None:
    disc = np.hypot(*np.mgrid[-19.5:20:1, -19.5:20:1]) <= 20
    disc_blob = _blob(0, 0, 40, 40, np.where(disc, 255, 0).astype(np.uint8))
    other = _blob(60, 60, 100, 100, np.where(disc, 255, 0).astype(np.uint8))
    assert blob_gap(disc_blob, other) == pytest.approx(math.hypot(60, 60) - 40, abs=2.5)


def test_the_penalty_is_linear_up_to_the_walkable_distance_and_a_sigmoid_beyond() -> None:
    assert distance_cost(0.0) == 0.0
    assert distance_cost(0.7) == 0.7
    assert distance_cost(1.0) == 1.0
    assert distance_cost(2.0) == pytest.approx(26.0)
    assert distance_cost(1.7) == pytest.approx(50 / (math.exp(2) + 1) + 1)
    assert distance_cost(5.0) == pytest.approx(51.0)


@given(st.floats(0, 6), st.floats(0, 6))
def test_the_penalty_grows_with_distance(one: float, other: float) -> None:
    near, far = sorted((one, other))
    assert distance_cost(near) <= distance_cost(far)


def test_the_penalty_depends_on_the_time_between_samples() -> None:
    blobs = [_blob(0, 0, 20, 20)], [_blob(70, 0, 100, 20)]
    short, long = (
        float(distance_costs(*blobs, seconds, PIXELS_PER_METER, SETTINGS)[0, 0]) for seconds in (0.5, 2.0)
    )
    assert short > 1.0
    assert long == pytest.approx((0.16 + 1.0) / (1.45 * 2.0), abs=0.02)


@given(st.integers(0, 10_000), st.integers(1, 400), st.integers(1, 400))
def test_the_intersection_of_shares_equals_that_of_counts(seed: int, size: int, model_size: int) -> None:
    rng = np.random.default_rng(seed)
    found = np.bincount(rng.integers(0, 6, size), minlength=BINS)
    model = np.bincount(rng.integers(2, 8, model_size), minlength=BINS)
    scaled = found * model.sum() / found.sum()
    expected = 1 - np.minimum(scaled, model).sum() / model.sum()
    assert float(mismatch(found / found.sum(), model / model.sum())) == pytest.approx(expected)


def test_colors_count_and_brightness_does_not() -> None:
    mask = np.full((10, 10), 255, dtype=np.uint8)

    def histogram(*bgr: int) -> np.ndarray:
        return uv_histogram(np.full((10, 10, 3), bgr, dtype=np.uint8), mask)

    assert float(mismatch(histogram(60, 60, 60), histogram(200, 200, 200))) == 0.0
    assert float(mismatch(histogram(40, 40, 180), histogram(180, 40, 40))) == 1.0


def test_only_the_pixels_of_the_mask_count() -> None:
    image = np.zeros((4, 4, 3), dtype=np.uint8)
    image[:2] = (40, 40, 180)
    mask = np.zeros((4, 4), dtype=np.uint8)
    mask[:2] = 255
    assert uv_histogram(image, mask).max() == 1.0
    assert not uv_histogram(image, np.zeros_like(mask)).any()


def test_appearance_is_compared_with_the_nearest_learned_region() -> None:
    regions = RegionalAppearance(3, (300, 300))
    red, blue = np.eye(BINS)[0], np.eye(BINS)[1]
    here, there = np.array([[40.0, 40.0]]), np.array([[250.0, 250.0]])
    assert regions.costs(here, red[None], 0.5) == [0.5]
    regions.store(here[0], red)
    regions.store(there[0], blue)
    assert regions.costs(here + 20, red[None], 0.5) == [0.0]
    assert regions.costs(there - 20, red[None], 0.5) == [1.0]
    for step in range(40):
        regions.store(np.array([float(step * 7 % 300), float(step * 13 % 300)]), red)
    assert len(regions) <= 9
    regions.store(here[0], blue)
    assert regions.costs(here, blue[None], 0.5) == [0.0], "the appearance of that region is replaced"


def _room(rng: np.random.Generator) -> np.ndarray:
    shade = np.linspace(90, 150, 120)[None, :, None] + np.zeros((90, 120, 3))
    return np.clip(shade + rng.normal(0, 2, shade.shape), 0, 255).astype(np.uint8)


def test_changes_of_the_room_are_foreground_and_noise_is_not() -> None:
    rng = np.random.default_rng(1)
    background = YuvBackground([_room(rng) for _ in range(20)], BlobSettings())
    image = _room(rng)
    image[30:60, 40:60] = (60, 60, 170)
    found = background.foreground(image) > 0
    assert found[32:58, 42:58].mean() > 0.98
    found[28:62, 38:62] = False
    assert found.mean() < 0.005


def test_the_distance_is_the_mahalanobis_distance_in_yuv() -> None:
    rng = np.random.default_rng(2)
    room = rng.integers(80, 160, (30, 40, 3))
    # Most pixels are unchanged, so that no change of exposure is estimated.
    images = [
        (room + rng.choice([-3, 0, 3], room.shape, p=[0.15, 0.7, 0.15])).astype(np.uint8) for _ in range(30)
    ]
    settings = BlobSettings()
    background = YuvBackground(images, settings)
    levels = np.stack([cv2.cvtColor(image, cv2.COLOR_BGR2YUV) for image in images]).astype(float)
    mean = levels.mean(axis=0)
    off = levels - mean
    floors = np.diag([settings.brightness_floor, settings.chroma_floor, settings.chroma_floor]) ** 2
    covariance = np.einsum("nhwi,nhwj->hwij", off, off) / len(images) + floors
    image = images[0].copy()
    image[5:15, 5:15] = (60, 60, 170)
    offset = cv2.cvtColor(image, cv2.COLOR_BGR2YUV) - mean
    expected = np.einsum("hwi,hwij,hwj->hw", offset, np.linalg.inv(covariance), offset)
    np.testing.assert_allclose(background.squared_distance(image), expected, rtol=1e-3, atol=1e-3)


def test_a_person_walking_through_during_learning_is_not_part_of_the_background() -> None:
    rng = np.random.default_rng(3)
    images = []
    for step in range(20):
        image = _room(rng)
        image[30:60, 5 * step : 5 * step + 15] = (60, 60, 170)
        images.append(image)
    background = YuvBackground(images, BlobSettings())
    assert (background.foreground(_room(rng)) > 0).mean() < 0.005


def test_a_slowly_changing_background_is_learned_outside_of_people() -> None:
    rng = np.random.default_rng(4)
    detector = BlobDetector((120, 90), 6.0, BlobSettings(learn_s=2.0), sample_s=0.6)
    detector.prepare([_room(rng) for _ in range(20)])
    person = slice(30, 60), slice(40, 60)
    for step in range(40):
        image = _room(rng)
        image[:, 80:] = np.clip(image[:, 80:] + 1.5 * step, 0, 255).astype(np.uint8)
        image[person] = (60, 60, 170)
        found = detector.detect(image, learn=True)
        assert len(found) == 1, f"step {step}"
    box = found[0].box
    assert np.abs(box - [40, 30, 60, 60]).max() <= 3


def test_blobs_are_merged_and_specks_are_dropped() -> None:
    rng = np.random.default_rng(5)
    detector = BlobDetector((120, 90), 6.0, BlobSettings())
    detector.prepare([_room(rng) for _ in range(20)])
    image = _room(rng)
    image[20:40, 20:34] = (60, 60, 170)
    image[41:55, 20:34] = (170, 60, 60)
    image[70:72, 100:102] = 0
    (only,) = detector.detect(image, learn=False)
    assert only.box[1] <= 20
    assert only.box[3] >= 55
    assert only.colors.sum() == pytest.approx(1.0)
    assert (only.colors > 0.3).sum() == 2
