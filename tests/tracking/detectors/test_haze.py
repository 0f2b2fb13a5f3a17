"""Haze: fog that is denser farther away is no person, and people in it are still detected."""

from __future__ import annotations

import numpy as np
import pytest

from fakes.tracking.drawn_people import HEIGHT, SCENE, Figure, Picture, picture
from tracking.boxes import iou
from tracking.detectors import BackgroundDetector
from tracking.detectors.background.light.haze import find_haze
from tracking.detectors.background.light.local_light import reduce_to_cells

SURE, VEIL = 0.4, 190.0
DARK_COATS = [Figure(30 + 90 * k, 150 + 30 * k, color=(15, 18, 22)) for k in range(3)]


def fog(image: Picture, density: float) -> Picture:
    """Return the image in fog that takes a share of the contrast, at the top most."""
    share = (density * np.linspace(1.0, 0.3, HEIGHT))[:, None, None]
    return np.asarray(image + share * (VEIL - image) + 0.5, dtype=np.uint8)


@pytest.mark.parametrize("density", [0.2, 0.5, 0.7])
def test_the_contrast_of_each_row_is_found_also_behind_people(density: float) -> None:
    for people in ([], DARK_COATS):
        haze = find_haze(reduce_to_cells(fog(picture(people, 0), density)), reduce_to_cells(SCENE))
        assert haze is not None
        # Where the ground has one level, gain and offset cannot be told apart; what it looks like can.
        difference = np.abs(haze.apply(SCENE).astype(int) - fog(SCENE, density))
        assert np.mean(difference) < 4.0
        assert np.mean(np.abs(haze.remove(fog(SCENE, density)).astype(int) - SCENE)) < 8.0


def test_people_and_exposure_noise_are_no_haze() -> None:
    random = np.random.default_rng(1)
    for people in ([], DARK_COATS):
        noisy = np.clip(picture(people, 0) + random.normal(0.0, 8.0, SCENE.shape), 0, 255).astype(np.uint8)
        assert find_haze(reduce_to_cells(noisy), reduce_to_cells(SCENE)) is None


@pytest.mark.parametrize("density", [0.5, pytest.param(0.7, marks=pytest.mark.slow)])
def test_people_abreast_in_dark_coats_are_no_shadow_in_fog(density: float) -> None:
    detector = BackgroundDetector()
    detector.prepare([picture([], frame) for frame in range(20)], every_s=0.2)
    walkers = [Figure(60 + 56 * k, 280, speed=0.6, color=(15, 18, 22)) for k in range(3)]
    for frame in range(100):
        found = detector.detect(fog(picture(walkers, frame), density * min(frame / 50, 1.0)))
        if frame >= 50:
            boxes = found.boxes[found.scores > SURE]
            truth = np.array([walker.box(frame) for walker in walkers])
            assert len(boxes) == len(walkers)
            assert (iou(truth[:, None], boxes[None]).max(axis=1) > 0.5).all()
