"""The color model that separates moving objects from swaying background."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.operator_assist.background_colors import ForegroundColors
from tracking.detectors import Image
from tracking.detectors.base import Mask

WATER, WEED, FISH, PALE = (150, 120, 40), (40, 110, 50), (30, 120, 240), (90, 130, 190)


def _picture(weed: int, fish: int, color: tuple[int, int, int] = FISH) -> Image:
    image = np.full((60, 80, 3), WATER, dtype=np.uint8)
    image[30:, weed : weed + 12] = WEED
    image[10:22, fish : fish + 20] = color
    return image


def _taught(pale: bool) -> ForegroundColors:
    """A weed that sways by its own width in front of half of the pictures, and a fish that swims by."""
    detections: list[tuple[Image, Mask]] = []
    for n in range(12):
        image = _picture(20 + 3 * (n % 2), 5 * n, PALE if pale and n % 3 == 0 else FISH)
        mask = np.zeros((60, 80), dtype=np.uint8)
        mask[10:22, 5 * n : 5 * n + 20] = 255
        mask[30:, 32:35] = 255 * (n % 2)
        detections.append((image, mask))
    return ForegroundColors(detections)


def test_what_swims_has_familiar_colors_and_what_sways_has_not() -> None:
    shares = _taught(pale=False).shares(_picture(40, 50))
    assert shares.shape == (60, 80)
    assert shares[10:22, 50:70].min() > 0.9
    assert shares[30:, 40:52].max() < 0.3
    assert shares[:8].max() < 0.1


@pytest.mark.parametrize("pale", [True, False])
def test_who_is_pale_in_the_murk_is_known_where_somebody_pale_was_seen(pale: bool) -> None:
    shares = _taught(pale).shares(_picture(40, 50, PALE))
    assert (shares[10:22, 50:70].min() > 0.9) == pale


def test_a_color_that_was_never_seen_says_nothing() -> None:
    assert np.allclose(_taught(pale=False).shares(np.full((4, 5, 3), 255, dtype=np.uint8)), 0.5)


def test_without_a_picture_every_color_says_nothing() -> None:
    assert np.allclose(ForegroundColors([]).shares(_picture(0, 0)), 0.5)
