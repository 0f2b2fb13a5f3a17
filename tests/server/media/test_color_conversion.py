"""Pictures are converted as if each was the first one, whatever came before it."""

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


def test_pictures_of_many_sizes_and_kinds_by_turns_are_what_each_is_alone() -> None:
    pictures = [decoded(seed, kind) for seed in range(9) for kind in ("yuv420p", "yuvj420p", "gray")]
    for picture in pictures:
        assert np.array_equal(to_bgr(picture), picture.to_ndarray(format="bgr24"))


def test_what_is_encoded_is_what_it_would_be_alone() -> None:
    for seed in range(9):
        image = decoded(seed).to_ndarray(format="bgr24")
        alone = VideoFrame.from_ndarray(image, format="bgr24").reformat(format="yuv420p")
        assert np.array_equal(to_yuv(image).to_ndarray(), alone.to_ndarray())


def test_threads_do_not_disturb_each_other() -> None:
    pictures = [decoded(seed) for seed in range(200)]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(to_bgr, pictures))
    for picture, image in zip(pictures, found, strict=True):
        assert np.array_equal(image, picture.to_ndarray(format="bgr24"))


def test_colours_that_cannot_be_converted_are_taken_for_the_usual_ones() -> None:
    usual, unknown = decoded(2), [3, 8, 10, 13, 14, 200]
    usual.colorspace = Colorspace.ITU601
    for number in unknown:
        picture = decoded(2)
        picture.colorspace = number
        assert np.array_equal(to_bgr(picture), to_bgr(usual)), number
    assert np.array_equal(
        to_bgr(decoded(2)), decoded(2).to_ndarray(format="bgr24")
    )  # as if they had not been
