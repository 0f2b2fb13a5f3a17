"""Tone curves: what a camera's exposure did to the background is found also where a crowd covers it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from tracking.detectors.background.light.tone_curve import IDENTITY, fit_tone_curves

HEIGHT, WIDTH = 144, 180
Levels = npt.NDArray[np.float64]
Change = Callable[[Levels], Levels]
CHANGES: dict[str, Change] = {
    "none": lambda levels: levels,
    "45 % darker": lambda levels: 0.55 * levels,
    "40 % brighter, clipped": lambda levels: 1.4 * levels,
    "white balance": lambda levels: levels * np.array([1.25, 1.0, 0.8]),
    "gamma": lambda levels: 255.0 * (levels / 255.0) ** 0.65,
    "compressed highlights": lambda levels: np.where(levels > 128.0, 128.0 + 0.5 * (levels - 128.0), levels),
    "haze": lambda levels: 0.7 * levels + 60.0,
}


def background(seed: int) -> npt.NDArray[np.uint8]:
    """Return a picture of smooth patches with all levels."""
    rng = np.random.default_rng(seed)
    patches = rng.uniform(10.0, 245.0, (12, 15, 3)).repeat(12, axis=0).repeat(12, axis=1)
    return np.clip(patches + rng.normal(0.0, 3.0, patches.shape), 0, 255).astype(np.uint8)


def changed(image: npt.NDArray[np.uint8], change: Change) -> npt.NDArray[np.uint8]:
    return np.clip(np.rint(change(image.astype(np.float64))), 0, 255).astype(np.uint8)


def add_crowd(image: npt.NDArray[np.uint8], share: float, seed: int) -> npt.NDArray[np.uint8]:
    """Cover a share of the columns with people in clothes of any color."""
    rng = np.random.default_rng(seed)
    crowded = image.copy()
    while np.mean((crowded != image).any(axis=2)) < share:
        left, top = int(rng.integers(0, WIDTH - 20)), int(rng.integers(0, HEIGHT // 2))
        crowded[top:, left : left + 20] = rng.uniform(0.0, 255.0, 3).astype(np.uint8)
    return crowded


@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("crowd", [0.0, 0.6])
def test_a_change_of_light_is_found_in_one_frame(name: str, crowd: float) -> None:
    old = background(1)
    truth = changed(old, CHANGES[name])
    frame = add_crowd(truth, crowd, 2)
    for previous in (None, IDENTITY):
        expected = fit_tone_curves(frame, old, None, previous).apply(old)
        error = np.abs(expected.astype(int) - truth)
        assert np.mean(error.max(axis=2) > 20) < 0.08, f"{name} from {previous}: {error.mean():.1f}"


@pytest.mark.parametrize("name", CHANGES)
def test_a_frame_is_brought_back_to_the_levels_of_the_background(name: str) -> None:
    old = background(3)
    frame = changed(old, CHANGES[name])
    restored = fit_tone_curves(frame, old).invert(frame, old)
    assert np.abs(restored.astype(int) - old).mean() < 3.0


def test_people_do_not_bend_the_curve_at_levels_that_the_background_lacks() -> None:
    old = np.clip(background(4), 60, 140)
    frame = add_crowd(old, 0.5, 5)
    levels = np.arange(0, 256, 5, dtype=np.uint8)[None, :, None].repeat(3, axis=2)
    curves = IDENTITY
    for _ in range(20):
        curves = fit_tone_curves(frame, old, None, curves)
    assert np.abs(curves.apply(levels).astype(int) - levels).max() < 25
