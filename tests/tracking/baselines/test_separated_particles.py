"""Separated particle filters: part histograms, the overlap factor, and crossings of similar people."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.crossings import BLUE, RED, Clothes, Crossing, count_tracked_scenes
from tracking.baselines.integral_histograms import (
    CHANNELS,
    LEVELS,
    ChannelIntegralImage,
    bhattacharyya_coefficient,
    split_boxes,
)
from tracking.baselines.particles.particle_filter import ParticleFilters, ParticleSettings
from tracking.baselines.particles.separated_particles import (
    SeparatedParticles,
    SeparatedParticleSettings,
    overlap_factors,
)

SEEDS = range(6)


@given(st.integers(0, 500), st.lists(st.tuples(*[st.integers(-20, 60)] * 4), min_size=1, max_size=5))
@settings(deadline=None, max_examples=60)
def test_part_histograms_equal_counted_ones(seed: int, corners: list[tuple[int, int, int, int]]) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (30, 40, 3)).astype(np.uint8)
    boxes = np.array([[min(a, c), min(b, d), max(a, c), max(b, d)] for a, b, c, d in corners], dtype=float)
    field_box = np.array([5.0, -3.0, 33.0, 22.0])  # the field is clipped to this box
    expected = np.zeros((len(boxes), CHANNELS, LEVELS))
    for row, box in enumerate(boxes):
        left, top, right, bottom = np.clip(box, [5, 0, 5, 0], [33, 22, 33, 22]).astype(int)
        one = 1 / max((bottom - top) * (right - left), 1)
        for y in range(top, bottom):
            for x in range(left, right):
                for channel in range(CHANNELS):
                    expected[row, channel, image[y, x, channel] // 32] += one
    assert np.allclose(ChannelIntegralImage(image, field_box).histograms(boxes), expected)


def test_parts_are_cut_row_by_row() -> None:
    parts = split_boxes(np.array([10.0, 20.0, 30.0, 80.0]), rows=3, columns=2)
    assert parts.tolist() == [
        [10, 20, 20, 40],
        [20, 20, 30, 40],
        [10, 40, 20, 60],
        [20, 40, 30, 60],
        [10, 60, 20, 80],
        [20, 60, 30, 80],
    ]


@given(st.integers(0, 1000), st.integers(1, 4), st.integers(1, 6))
@settings(deadline=None, max_examples=60)
def test_the_overlap_factor_equals_the_counted_share(seed: int, objects: int, reduced: int) -> None:
    rng = np.random.default_rng(seed)
    middles = [rng.uniform(-10, 20, (int(rng.integers(1, 30)), 2)) for _ in range(objects)]
    for number, factors in enumerate(overlap_factors(middles, reduced)):
        assert factors.shape == (len(middles[number]),)
        for (x, y), factor in zip(middles[number], factors, strict=True):
            cell = (x // reduced, y // reduced)
            counts = [
                sum((a // reduced, b // reduced) == cell for a, b in positions) for positions in middles
            ]
            assert factor == pytest.approx(counts[number] / sum(counts))


@given(st.integers(0, 1000))
@settings(deadline=None, max_examples=30)
def test_isolated_objects_have_overlap_factor_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    apart = [rng.uniform(0, 40, (20, 2)), rng.uniform(60, 90, (20, 2))]
    assert all((factors == 1.0).all() for factors in overlap_factors(apart, 4))
    assert all((factors == 0.5).all() for factors in overlap_factors([apart[0], apart[0]], 4))


def test_the_bhattacharyya_coefficient_is_1_for_equal_and_0_for_disjoint_histograms() -> None:
    shares = np.eye(LEVELS)[[0, 3]]
    assert bhattacharyya_coefficient(shares, shares).tolist() == [1.0, 1.0]
    assert float(bhattacharyya_coefficient(shares[0], shares[1])) == 0.0


def test_two_similar_people_who_cross_are_kept_where_independent_filters_fail() -> None:
    scenes = [Crossing((RED, RED), seed=seed) for seed in SEEDS]
    apart = count_tracked_scenes(
        [SeparatedParticles(SeparatedParticleSettings(seed=seed)) for seed in SEEDS], scenes
    )
    together = count_tracked_scenes([ParticleFilters(ParticleSettings(seed=seed)) for seed in SEEDS], scenes)
    assert apart >= len(SEEDS) - 1
    assert together <= len(SEEDS) - 2


@pytest.mark.parametrize(("in_front", "behind"), [(RED, False), (BLUE, True)])
def test_only_a_person_in_other_clothes_counts_as_an_occluder(in_front: Clothes, behind: bool) -> None:
    method = SeparatedParticles()
    apart = Crossing((RED, in_front))
    people = [method.initialize(apart.picture(0), apart.where(person, 0)) for person in range(2)]
    for _ in range(SeparatedParticleSettings().reference_frames + 1):
        method.predict(apart.picture(0), people)
    covered = apart.picture(0)
    (left, top), (other, _) = (apart.where(person, 0)[:2].astype(int) for person in range(2))
    covered[top : top + 44, left : left + 18] = covered[top : top + 44, other : other + 18]
    field = ChannelIntegralImage(covered, np.array([0.0, 0.0, 200.0, 120.0]))
    assert method._is_occluded(field, people[0]) is behind


@pytest.mark.parametrize("wrong", [{"particles": 0}, {"rows": 0}, {"cell_pixels": 0}, {"sharpness": 0.0}])
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        SeparatedParticleSettings(**wrong)  # type: ignore[arg-type]
