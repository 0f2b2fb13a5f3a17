"""Reused converters give the same pictures as new ones."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from av.video.frame import VideoFrame
from av.video.reformatter import Colorspace

from server.media.color_conversion import to_bgr, to_yuv

SIZES = ((64, 48), (34, 18), (640, 360))


def decoded(seed: int, kind: str = "yuv420p") -> VideoFrame:
    """Return a picture of one of some sizes as a decoder does."""
    width, height = SIZES[seed % len(SIZES)]
    rows = np.random.default_rng(seed).integers(0, 255, (height * 3 // 2, width), dtype=np.uint8)
    return VideoFrame.from_ndarray(rows, format="yuv420p").reformat(format=kind)


def test_alternating_sizes_and_formats_do_not_affect_each_other() -> None:
    pictures = [decoded(seed, kind) for seed in range(9) for kind in ("yuv420p", "yuvj420p", "gray")]
    for picture in pictures:
        assert np.array_equal(to_bgr(picture), picture.to_ndarray(format="bgr24"))


def test_conversion_to_yuv_is_that_of_a_new_converter() -> None:
    for seed in range(9):
        image = decoded(seed).to_ndarray(format="bgr24")
        alone = VideoFrame.from_ndarray(image, format="bgr24").reformat(format="yuv420p")
        assert np.array_equal(to_yuv(image).to_ndarray(), alone.to_ndarray())


def test_threads_do_not_disturb_each_other() -> None:
    pictures = [decoded(seed) for seed in range(200)]
    with ThreadPoolExecutor(4) as pool:
        converted = list(pool.map(to_bgr, pictures))
    for picture, image in zip(pictures, converted, strict=True):
        assert np.array_equal(image, picture.to_ndarray(format="bgr24"))


def test_unsupported_color_spaces_are_converted_by_bt601() -> None:
    usual, unknown = decoded(2), [3, 8, 10, 13, 14, 200]
    usual.colorspace = Colorspace.ITU601
    for number in unknown:
        picture = decoded(2)
        picture.colorspace = number
        assert np.array_equal(to_bgr(picture), to_bgr(usual)), number
    assert np.array_equal(
        to_bgr(decoded(2)), decoded(2).to_ndarray(format="bgr24")
    )  # the converter still works as before
