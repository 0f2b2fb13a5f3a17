"""Images at another size: fine detail becomes its mean, whatever the sizes are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tracking.baselines.temporal_consistency.blobs import BlobDetector
from tracking.baselines.temporal_consistency.settings import BlobSettings
from tracking.detectors import BackgroundDetector
from tracking.image_scaling import scale_image, working_scale

SIZES = [(3840, 2160, 300, 300), (1920, 1080, 360, 202), (1367, 771, 300, 169), (1080, 1920, 202, 360)]


@pytest.mark.parametrize(("width", "height", "to_width", "to_height"), SIZES)
def test_what_is_finer_than_a_pixel_becomes_its_mean(
    width: int, height: int, to_width: int, to_height: int
) -> None:
    striped = np.zeros((height, width, 3), dtype=np.uint8)
    striped[:, ::2] = 200
    small = scale_image(striped, (to_width, to_height))
    assert small.shape == (to_height, to_width, 3)
    # A pixel that has half a stripe more than another differs by that share of its width.
    np.testing.assert_allclose(small, 100.0, atol=100.0 * to_width / width + 2.0)


@pytest.mark.parametrize(("width", "height", "to_width", "to_height"), SIZES)
def test_everything_stays_where_it_is(width: int, height: int, to_width: int, to_height: int) -> None:
    rng = np.random.default_rng(1)
    rough = rng.integers(0, 256, (9, 16, 3), dtype=np.uint8)
    image = np.asarray(cv2.resize(rough, (width, height), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    expected = cv2.resize(image, (to_width, to_height), interpolation=cv2.INTER_AREA)
    difference = np.abs(scale_image(image, (to_width, to_height)).astype(int) - expected)
    assert difference.max() <= 3
    assert difference.mean() < 0.6


def test_an_image_grows_without_steps_and_is_left_alone_at_its_own_size() -> None:
    ramp = np.repeat(np.array([[[0], [100]]], dtype=np.uint8), 3, axis=2)
    assert np.unique(scale_image(ramp, (8, 1))[0, :, 0]).tolist() == [0, 13, 38, 63, 88, 100]
    assert scale_image(ramp, (2, 1)) is ramp


@pytest.mark.parametrize(
    ("size", "searched"),
    [
        ((3840, 2160), (360, 202)),
        ((1280, 720), (360, 202)),
        ((768, 576), (360, 270)),
        ((720, 576), (360, 288)),
        ((360, 288), (360, 288)),
        ((320, 240), (320, 240)),
        ((1080, 1080), (322, 322)),
        ((576, 768), (279, 372)),
        ((1080, 1920), (241, 429)),
        ((2160, 3840), (241, 429)),
        ((200, 360), (200, 360)),
    ],
)
def test_pictures_are_searched_at_one_width_or_if_they_are_taller_at_one_area(
    size: tuple[int, int], searched: tuple[int, int]
) -> None:
    scale = working_scale(size, 360)
    assert (round(size[0] * scale), round(size[1] * scale)) == searched


def test_both_background_models_search_a_portrait_picture_at_that_scale() -> None:
    detector = BackgroundDetector()
    detector.detect(np.zeros((1920, 1080, 3), dtype=np.uint8))
    assert detector.grid.work_size == (241, 429)
    assert BlobDetector((1080, 1920), 6.0, BlobSettings(work_width=360)).size == (241, 429)
