"""Flicker: leaves in the wind are no people; a crowd that walks is no flicker."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest

from fakes.tracking.drawn_people import HEIGHT, SCENE, WIDTH, Figure, Picture, picture
from synthetic.scene import Scene
from tracking.boxes import iou
from tracking.detectors import BackgroundDetector
from tracking.detectors.background.flicker import FlickerFinder

FPS, CHECK_S, CHECKS = 25.0, 0.2, 60
SWING = 40
"""Frames in which a leaf swings to and fro."""
CANVAS = np.full((HEIGHT, WIDTH, 3), 120, dtype=np.uint8)
TREE = slice(20, 220), slice(0, 70)


@cache
def leaves(step: int) -> Picture:
    """Return leaves that swing to and fro at the left side, before black."""
    random = np.random.default_rng(3)
    canvas = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
    for x, y, shade, phase in random.uniform(size=(260, 4)).tolist():
        left = 70 * x + 8 * np.sin(2 * np.pi * (step / SWING + phase))
        leaf = tuple(int((0.4 + 0.6 * shade) * level) for level in (60, 140, 80))
        cv2.ellipse(canvas, (round(left), round(20 + 200 * y)), (4, 8), 30.0, 0.0, 360.0, leaf, -1)
    return canvas


def with_tree(image: Picture, frame: int) -> Picture:
    """Draw the leaves before a picture."""
    drawn = leaves(frame % SWING)
    return np.where(drawn.any(axis=2, keepdims=True), drawn, image)


def foreground(image: Picture, background: Picture) -> Picture:
    """Return where a picture differs from the background."""
    return np.where(cv2.absdiff(image, background).max(axis=2) > 24, 255, 0).astype(np.uint8)


def test_what_keeps_changing_is_flicker_until_it_is_calm() -> None:
    random, finder = np.random.default_rng(1), FlickerFinder(CHECK_S)
    tree = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    tree[TREE] = 255
    image = CANVAS
    for _ in range(CHECKS):
        image = CANVAS.copy()
        image[TREE] = random.integers(0, 256, image[TREE].shape)
        finder.check(image, tree)
    assert finder.mask is not None
    assert np.mean(finder.mask == tree) > 0.98
    for _ in range(CHECKS):
        finder.check(image, tree)
    assert finder.mask is None


@pytest.mark.parametrize("spacing", [90, 140])
def test_people_who_walk_by_and_one_who_stands_are_no_flicker(spacing: int) -> None:
    finder = FlickerFinder(CHECK_S)
    stands = Figure(200, 250)
    for check in range(2 * CHECKS):
        frame = 5 * check
        walkers = [Figure(-400 - spacing * k + 2.0 * frame, 200) for k in range(12)]
        image = picture([*walkers, stands], frame)
        finder.check(image, foreground(image, SCENE))
        assert finder.mask is None


@pytest.mark.parametrize("every", [5, 12])
def test_a_crowd_that_mills_about_is_no_flicker(every: int) -> None:
    scene = Scene("room", 4, 8, 1, 320, 180, FPS)
    empty, finder = scene.clean_background(0), FlickerFinder(every / FPS)
    for frame in range(350, 650, every):
        image = scene.image(0, frame)
        finder.check(image, foreground(image, empty))
        assert finder.mask is None


def test_leaves_in_the_wind_are_no_people_after_some_seconds() -> None:
    detector = BackgroundDetector(fps=12.5)
    detector.prepare([picture([], frame) for frame in range(20)], every_s=0.2)
    walker, false = Figure(60, 270, speed=0.5), 0
    for frame in range(0, 320, 2):
        found = detector.detect(with_tree(picture([walker], frame), frame))
        if frame >= 250:
            overlaps = iou(found.boxes[found.scores > 0.4], walker.box(frame))
            assert overlaps.max(initial=0.0) > 0.5
            false += np.count_nonzero(overlaps < 0.1)
    assert false <= 3
