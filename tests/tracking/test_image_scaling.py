"""Images at another size: fine detail becomes its mean, whatever the sizes are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tracking.image_scaling import scale_image

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
