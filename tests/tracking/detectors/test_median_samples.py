"""While a view is learned, a camera that turns on is told from people who walk and from a mast that sways."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from fakes.tracking.drawn_people import HEIGHT, NOISE, WIDTH, Figure, draw
from tracking.detectors import BackgroundDetector
from tracking.detectors.background.median_samples import MedianSamples

SIZE = (WIDTH, HEIGHT)
FPS, EVERY = 25.0, 3
SAMPLES = 15
"""As many as a camera of 25 frames a second takes in its two seconds, every third frame."""


def hall() -> np.ndarray:
    """Return a wide scene with things of all sizes, 1400 x 288."""
    random = np.random.default_rng(5)
    scene = np.full((SIZE[1], 1400, 3), 120, dtype=np.uint8)
    for _ in range(500):
        x, y, w, h = (random.random(4) * (1400, SIZE[1], 60, 60)).astype(int).tolist()
        cv2.rectangle(scene, (x, y), (x + 4 + w, y + 4 + h), random.integers(20, 235, 3).tolist(), -1)
    return scene


HALL = hall()


def crowd(seed: int, people: int = 10) -> list[Figure]:
    """Return people who all walk one way, each at a speed and in a color of their own."""
    random = np.random.default_rng(seed)
    way = (-1.0, 1.0)[seed % 2]
    return [
        Figure(
            float(random.uniform(-40.0, SIZE[0])),
            float(random.uniform(150.0, 286.0)),
            way * float(random.uniform(2.0, 3.5)),
            color=(
                int(random.integers(20, 235)),
                int(random.integers(20, 235)),
                int(random.integers(20, 235)),
            ),
        )
        for _ in range(people)
    ]


def seen(at: float, figures: Sequence[Figure], frame: int, down: float = 0.0) -> np.ndarray:
    """Return what a camera shows that looks at a column of the hall, with noise."""
    place = np.array([[1.0, 0.0, -at], [0.0, 1.0, -down]])
    shown = cv2.warpAffine(HALL, place, SIZE, borderMode=cv2.BORDER_REFLECT)
    for figure in sorted(figures, key=lambda figure: figure.foot):
        draw(shown, figure, frame)
    noise = np.roll(NOISE, (7 * frame, 13 * frame), axis=(0, 1))
    return np.asarray(cv2.add(shown, noise, dtype=cv2.CV_8U))


def moves(pictures: Sequence[np.ndarray]) -> list[bool]:
    """Return of each picture but the first whether the camera seems to have moved since the one before."""
    samples, found = MedianSamples(), []
    for picture in pictures:
        found.append(samples.have_moved(picture))
        samples.add(picture)
    assert not found[0]
    return found[1:]


@pytest.mark.parametrize("seed", range(6))
def test_people_who_all_walk_one_way_are_no_turn(seed: int) -> None:
    figures = crowd(seed)
    pictures = [seen(300.0, figures, EVERY * sample) for sample in range(SAMPLES)]
    assert np.mean((pictures[7] != seen(300.0, [], 7 * EVERY)).any(axis=2)) > 0.1, "they hide much"
    assert not any(moves(pictures))


@pytest.mark.parametrize("people", [0, 10])
@pytest.mark.parametrize("widths_per_s", [-0.1, 0.1, 0.3, 0.8])
def test_a_turn_is_found_while_it_lasts_and_whoever_walks(widths_per_s: float, people: int) -> None:
    figures, step = crowd(3, people), widths_per_s * SIZE[0] * EVERY / FPS
    pictures = [seen(500.0 + step * sample, figures, EVERY * sample) for sample in range(SAMPLES)]
    assert np.mean(moves(pictures)) > 0.9, "a median does without one of the samples"


@pytest.mark.parametrize("people", [0, 10])
@pytest.mark.parametrize("widths_per_s", [0.025, -0.05])
def test_a_slow_turn_is_found_before_the_view_is_learned(widths_per_s: float, people: int) -> None:
    figures, step = crowd(3, people), widths_per_s * SIZE[0] * EVERY / FPS
    pictures = [seen(500.0 + step * sample, figures, EVERY * sample) for sample in range(SAMPLES)]
    assert moves(pictures)[-1]


def test_a_view_without_edges_does_not_turn() -> None:
    random = np.random.default_rng(1)
    fog = [random.normal(150.0, 3.0, (SIZE[1], SIZE[0], 3)).astype(np.uint8) for _ in range(SAMPLES)]
    assert not any(moves(fog))


def test_a_mast_that_sways_is_no_turn() -> None:
    """By a hundredth of the width to each side, and in front of people."""
    figures, seconds = crowd(2, 6), np.arange(SAMPLES) * EVERY / FPS
    across, down = (0.01 * SIZE[0] * np.sin(2.0 * np.pi * hertz * seconds) for hertz in (0.7, 0.9))
    pictures = [
        seen(400.0 + across[sample], figures, EVERY * sample, down[sample]) for sample in range(SAMPLES)
    ]
    assert not any(moves(pictures))


@pytest.mark.parametrize(("seconds", "seed"), [(1.0, 4), (4.0, 5)])
def test_a_turned_camera_is_located_once_and_for_all_while_people_walk_one_way(
    seconds: float, seed: int
) -> None:
    turned, begin = 120.0, 55
    rests = begin + round(seconds * FPS)
    figures = crowd(seed, 12)
    figures += [replace(each, left=each.left - each.speed * rests) for each in crowd(seed + 10, 12)]
    detector, located = BackgroundDetector(), []
    for frame in range(rests + 100):
        share = min(max((frame - begin) / (rests - begin), 0.0), 1.0)
        detector.detect(seen(500.0 - share * turned, figures, frame))
        motion = detector.camera_motion
        located.append(motion is not None and abs(motion[0, 2] / motion[2, 2] - turned) < 4.0)
    assert all(located[rests + 75 :]), "three seconds after it came to rest"
    assert not detector.warming_up
