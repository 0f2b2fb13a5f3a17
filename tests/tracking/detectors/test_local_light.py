"""Local light: sun over a part of the picture is no person, and people in it are still detected."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from fakes.tracking.drawn_people import HEIGHT, SCENE, WIDTH, Figure, Picture, picture
from tracking.boxes import iou
from tracking.detectors import BackgroundDetector
from tracking.detectors.background.light.frame_light import FrameLight
from tracking.detectors.background.light.local_light import find_local_light, reduce_to_cells, relight
from tracking.detectors.background.light.tone_curve import IDENTITY

SURE = 0.4
SHAPE = (HEIGHT, WIDTH)
CROWD = [Figure(20 + 55 * k, 160 + 18 * k, color=(40 + 30 * k, 60 * (k % 4), 250 - 45 * k)) for k in range(6)]


def shine(image: Picture, factor: float, begin: float = 0.5) -> Picture:
    """Return the image multiplied by a factor from a share of its width on."""
    columns = np.arange(WIDTH) / WIDTH
    share = np.clip((columns - begin) / 0.03 + 0.5, 0.0, 1.0)
    lit = image * (1.0 + (factor - 1.0) * share)[None, :, None]
    return np.asarray(np.clip(lit + 0.5, 0, 255), dtype=np.uint8)


def light_over(image: Picture) -> npt.NDArray[np.float32] | None:
    light = find_local_light(reduce_to_cells(image), FrameLight(IDENTITY), reduce_to_cells(SCENE))
    return None if light is None else light.gain(SHAPE)


@pytest.mark.parametrize("factor", [0.6, 1.25, 1.5])
def test_light_over_half_of_the_picture_is_found_also_behind_a_crowd(factor: float) -> None:
    for crowd in ([], CROWD):
        gain = light_over(shine(picture(crowd, 0), factor))
        assert gain is not None
        truth = shine(SCENE, factor).astype(int)
        error = np.minimum(
            np.abs(relight(SCENE, gain) - truth).max(axis=2), np.abs(SCENE - truth).max(axis=2)
        )
        assert np.mean(error > 20) < 0.03, "one of the two states fits nearly every pixel"
        np.testing.assert_allclose(np.median(gain[:, WIDTH // 2 + 20 :]), factor, rtol=0.06)
        np.testing.assert_allclose(np.median(gain[:, : WIDTH // 2 - 20]), 1.0, rtol=0.03)


def test_people_and_an_unchanged_picture_are_no_light() -> None:
    coats = [Figure(20 + 50 * k, 170 + 15 * k, color=(90, 95, 100)) for k in range(7)]
    for crowd in ([], CROWD, coats):
        assert light_over(picture(crowd, 0)) is None


@pytest.mark.parametrize(("begin", "sign"), [(-1.0, 1), (0.25, 1), (0.5, 0)])
def test_light_over_most_of_the_picture_is_the_exposure(begin: float, sign: int) -> None:
    lit = reduce_to_cells(shine(picture(CROWD, 0), 1.3, begin=begin))
    light = find_local_light(lit, FrameLight(IDENTITY), reduce_to_cells(SCENE))
    assert light is not None
    assert light.exposure_sign == sign


@pytest.mark.parametrize("factor", [1.5, pytest.param(0.6, marks=pytest.mark.slow)])
def test_sun_that_comes_and_goes_makes_no_people_and_hides_none(factor: float) -> None:
    walker = Figure(10, 200, speed=2.0, begin=30)
    detector, overlaps, false = BackgroundDetector(), [], 0
    for frame in range(170):
        image = picture([walker], frame)
        # The sun comes after two seconds, within one, and goes after four.
        sun = float(np.clip((frame - 60) / 25, 0.0, 1.0) * np.clip((130 - frame) / 10, 0.0, 1.0))
        seen = detector.detect(shine(image, 1.0 + (factor - 1.0) * sun))
        if frame >= 60:
            sure = seen.boxes[seen.scores >= SURE]
            found = iou(sure, walker.box(frame))
            overlaps.append(float(found.max(initial=0.0)))
            false += np.count_nonzero(found < 0.1)
    assert np.mean(np.array(overlaps) >= 0.5) >= 0.9
    assert false <= 5
