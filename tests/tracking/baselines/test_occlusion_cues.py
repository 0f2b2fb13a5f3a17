"""Occlusion cues: color mixtures, the contrast of windows, occluder shares, and tracking behind others."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.crossings import (
    BLUE,
    FRAMES,
    GRAY,
    GREEN,
    RED,
    Crossing,
    ThreeMeet,
    WalkTogether,
    count_tracked_scenes,
)
from tracking.baselines.particles.color_mixture import (
    CODE_COLORS,
    COLOR_CODES,
    color_codes,
    fit_mixture,
    posterior,
)
from tracking.baselines.particles.occluder_particles import OccluderParticles
from tracking.baselines.particles.occlusion_cues import (
    RING_AREA_RATIO,
    CenterSurroundIntegral,
    OcclusionCueSettings,
    OcclusionCueTracker,
    add_ring,
)
from tracking.baselines.particles.particle_filter import ParticleFilters, ParticleSettings

SEEDS = range(4)


def test_a_mixture_recovers_the_two_colors_that_pixels_were_drawn_from() -> None:
    rng = np.random.default_rng(3)
    drawn = np.concatenate([rng.normal([200, 40, 60], 6, (900, 3)), rng.normal([30, 90, 180], 12, (300, 3))])
    found = fit_mixture(np.clip(drawn, 0, 255).astype(np.uint8), components=2)
    order = np.argsort(-found.weights)
    assert found.weights[order] == pytest.approx([0.75, 0.25], abs=0.01)
    assert found.means[order] == pytest.approx(np.array([[200, 40, 60], [30, 90, 180]]), abs=2.5)


def test_densities_equal_the_formula() -> None:
    rng = np.random.default_rng(4)
    found = fit_mixture(rng.integers(0, 256, (400, 3)).astype(np.uint8), components=3)
    colors = rng.uniform(0, 255, (20, 3))
    for color, density in zip(colors, found.densities(colors), strict=True):
        expected = 0.0
        for share, mean, covariance in zip(found.weights, found.means, found.covariances, strict=True):
            difference = color - mean
            exponent = -0.5 * difference @ np.linalg.inv(covariance) @ difference
            expected += share * np.exp(exponent) / np.sqrt((2 * np.pi) ** 3 * np.linalg.det(covariance))
        assert density == pytest.approx(expected)


@pytest.mark.parametrize("pixels", [1, 5, 40])
def test_few_pixels_or_one_color_give_a_valid_mixture(pixels: int) -> None:
    one = np.full((pixels, 3), 77, dtype=np.uint8)
    densities = fit_mixture(one, components=3).densities(CODE_COLORS)
    assert np.isfinite(densities).all()
    assert color_codes(one[None])[0, 0] == int(np.argmax(densities))


def test_the_color_code_is_that_of_the_nearest_color() -> None:
    image = np.random.default_rng(5).integers(0, 256, (6, 7, 3)).astype(np.uint8)
    assert np.abs(CODE_COLORS[color_codes(image)] - image).max() <= 4
    assert CODE_COLORS.shape == (COLOR_CODES, 3)


def test_the_posterior_is_bayes_rule() -> None:
    likelihood, other_likelihoods = np.array([0.2, 0.0, 1e-5]), np.array([0.1, 0.3, 0.0])
    expected = [0.5 * 0.2 / (0.5 * 0.2 + 0.5 * 0.1), 0.0, 1.0]
    assert posterior(likelihood, other_likelihoods, 0.5) == pytest.approx(expected)
    assert posterior(np.zeros(1), np.zeros(1), 0.5).tolist() == [0.0]


@given(
    st.integers(0, 500),
    st.lists(st.tuples(*[st.integers(-8, 40)] * 2, *[st.integers(1, 25)] * 2), min_size=1),
)
@settings(deadline=None, max_examples=60)
def test_contrasts_equal_sums_over_pixels(seed: int, places: list[tuple[int, int, int, int]]) -> None:
    values = np.random.default_rng(seed).random((24, 32, 2)).astype(np.float32)
    windows = np.array([[x, y, x + w, y + h] for x, y, w, h in places], dtype=float)
    found = CenterSurroundIntegral(values, 3, 2).contrast(windows)
    for window, contrasts in zip(windows, found, strict=True):
        inner, outer = (np.rint(box) for box in (window, add_ring(window)))
        inside, ring = [], []
        for y in range(24):
            for x in range(32):
                at_x, at_y = x + 3, y + 2
                if inner[0] <= at_x < inner[2] and inner[1] <= at_y < inner[3]:
                    inside.append(values[y, x])
                elif outer[0] <= at_x < outer[2] and outer[1] <= at_y < outer[3]:
                    ring.append(values[y, x])
        expected = sum(inside, np.zeros(2)) / max(len(inside), 1) - sum(ring, np.zeros(2)) / max(len(ring), 1)
        assert contrasts == pytest.approx(expected, abs=1e-5)


def test_a_ring_has_its_share_of_the_windows_pixels() -> None:
    wide = add_ring(np.array([10.0, 20.0, 50.0, 100.0]))
    assert (wide[2] - wide[0]) * (wide[3] - wide[1]) == pytest.approx((1 + RING_AREA_RATIO) * 40 * 80)
    assert (wide[:2] + wide[2:]).tolist() == pytest.approx([60.0, 120.0])


@given(st.integers(0, 500), st.lists(st.sets(st.integers(1, 6), max_size=4), min_size=1, max_size=12))
@settings(deadline=None, max_examples=60)
def test_shares_stay_between_0_and_1(seed: int, neighbors: list[set[int]]) -> None:
    rng, shares = np.random.default_rng(seed), OccluderParticles.unoccluded(30)
    for near in neighbors:
        known = dict(zip(shares.occluder_ids, shares.states.mean(axis=0), strict=True))
        shares.resample_and_propagate(rng, sorted(near), 0.3, 0.1)
        assert shares.occluder_ids == tuple(sorted(near))
        assert shares.visible_and_hidden_shares.shape == (30, 1 + len(near))
        assert (shares.visible_and_hidden_shares >= -1e-12).all()
        assert np.allclose(shares.visible_and_hidden_shares.sum(axis=1), 1.0)
        assert set(known) - near == set(known) - set(shares.occluder_ids)


def test_a_share_stays_with_its_occluder_when_others_come_and_go() -> None:
    shares = OccluderParticles((4, 7), np.tile([0.1, 0.6], (10, 1)), np.full(10, 0.1))
    shares.resample_and_propagate(np.random.default_rng(1), [7, 9], 0.0)
    assert np.allclose(shares.states, [0.6, 0.0])
    assert np.allclose(shares.hidden_shares, 0.6)


def test_a_person_colored_like_the_wall_is_kept_behind_another_where_the_plain_filter_fails() -> None:
    scenes = [Crossing((GRAY, BLUE), seed=seed) for seed in SEEDS]
    assert count_tracked_scenes(
        [OcclusionCueTracker(OcclusionCueSettings(seed=seed)) for seed in SEEDS], scenes
    ) == len(SEEDS)
    plain = [ParticleFilters(ParticleSettings(seed=seed)) for seed in SEEDS]
    assert count_tracked_scenes(plain, scenes) <= len(SEEDS) - 2


def test_a_hidden_person_moves_with_the_occluder_past_a_distractor() -> None:
    scenes = [WalkTogether((RED, BLUE), seed=seed) for seed in SEEDS]
    with_cues = count_tracked_scenes(
        [OcclusionCueTracker(OcclusionCueSettings(seed=seed)) for seed in SEEDS], scenes
    )
    alone = [
        OcclusionCueTracker(OcclusionCueSettings(seed=seed, occlusion_noise=0.0, jump_share=0.0))
        for seed in SEEDS
    ]
    assert with_cues >= len(SEEDS) - 1
    assert count_tracked_scenes(alone, scenes) <= 1


def test_two_people_who_pass_behind_a_third_keep_their_ids() -> None:
    scenes = [ThreeMeet((RED, BLUE, GREEN), seed=seed) for seed in SEEDS]
    methods = [OcclusionCueTracker(OcclusionCueSettings(seed=seed)) for seed in SEEDS]
    assert count_tracked_scenes(methods, scenes) >= len(SEEDS) - 1


def test_the_hidden_share_is_large_only_during_the_occlusion() -> None:
    scene, method = Crossing((RED, BLUE)), OcclusionCueTracker()
    people = [method.initialize(scene.picture(0), scene.where(person, 0)) for person in range(2)]
    hidden = []
    for frame in range(1, FRAMES):
        method.predict(scene.picture(frame), people)
        hidden.append([float(person.occluders.weights @ person.occluders.hidden_shares) for person in people])
    behind, before = np.array(hidden).T
    assert behind[27:29].min() > 0.7
    assert max(behind[:20].max(), behind[36:].max(), before.max()) < 0.1


def test_the_same_seed_gives_the_same_predictions() -> None:
    scene = Crossing((RED, BLUE))
    runs = []
    for _ in range(2):
        method = OcclusionCueTracker()
        people = [method.initialize(scene.picture(0), scene.where(person, 0)) for person in range(2)]
        runs.append([method.predict(scene.picture(frame), people).tobytes() for frame in range(1, 12)])
    assert runs[0] == runs[1]


@pytest.mark.parametrize(
    "wrong",
    [{"particles": 0}, {"components": 0}, {"sharpness": 0.0}, {"occlusion_noise": -0.1}, {"jump_share": 0.6}],
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must be|between"):
        OcclusionCueSettings(**wrong)  # type: ignore[arg-type]
