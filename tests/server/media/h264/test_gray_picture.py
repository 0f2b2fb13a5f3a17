"""A gray picture is gray in every format, and does not affect the pictures around it."""

from __future__ import annotations

import contextlib
import io
from typing import Any

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fakes.media.h264 import PRESETS, decoded, encoded, slice_header_format
from fakes.service.parameter_sets import ENCODINGS, sent_units
from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, WIDTH
from server.camera.encoder import Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.media.bitstream import BitWriter, escape_payload
from server.media.containers.fmp4 import init_segment
from server.media.h264.annexb import H264ParameterSets, join_sample, parameter_sets
from server.media.h264.gray_picture import gray_picture
from server.media.nal_units import nal_units
from server.media.parameter_sets import UnsupportedParametersError
from server.media.picture import EncodedPicture
from server.media.stream_format import PerCameraStreamFormat, StreamFormat
from server.media.vp8.gray_frame import gray_frame
from server.media.vp8.stream_format import Vp8StreamFormat
from server.service.streaming.frame_buffer import FrameBuffer

Sizes = st.tuples(st.integers(1, 40), st.integers(1, 24))
"""In macroblocks."""


def is_gray(picture: NDArray[np.uint8]) -> bool:
    return bool((picture == 128).all())


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(PRESETS), Sizes)
def test_a_gray_picture_leaves_its_neighbors_unchanged(preset: str, blocks: tuple[int, int]) -> None:
    units = encoded((16 * blocks[0], 16 * blocks[1] + 2), preset, 3)
    samples = [join_sample(nal_units(unit.data)) for unit in units]
    parameters, writer = parameter_sets(nal_units(units[0].data)), slice_header_format(units[0])
    assert parameters is not None
    gray = [gray_picture(parameters, 0), writer.repeat(1, reference=True), gray_picture(parameters, 1)]
    shown, alone = decoded([*samples, *gray, *samples]), decoded(samples)
    assert len(shown) == 9
    assert all(map(is_gray, shown[3:6]))
    for place, picture in enumerate(shown[:3] + shown[6:]):
        np.testing.assert_array_equal(picture, alone[place % 3])


@settings(max_examples=10, deadline=None)
@given(Sizes)
def test_a_vp8_picture_is_gray(blocks: tuple[int, int]) -> None:
    width, height = 16 * blocks[0], 16 * blocks[1] + 2
    encoder = Encoder(
        SiteSettings(width=width, height=height, fps=FPS), EncodeSettings(gop_s=GOP / FPS, codec="vp8")
    )
    noise = np.random.default_rng(0).integers(0, 255, (3, height, width, 3), dtype=np.uint8)
    units = [encoder.encode(pulse, picture).data for pulse, picture in enumerate(noise)]

    def decode(frames: list[bytes]) -> list[NDArray[np.uint8]]:
        decoder = av.VideoCodecContext.create("vp8", "r")
        return [
            picture.to_ndarray(format="yuv420p")
            for frame in frames
            for picture in decoder.decode(av.Packet(frame))
        ]

    shown, alone = decode([*units, gray_frame(width, height), *units]), decode(units)
    assert is_gray(shown[3])
    for place, picture in enumerate(shown[:3] + shown[4:]):
        np.testing.assert_array_equal(picture, alone[place % 3])


@pytest.mark.parametrize("own", [False, True])
def test_a_gray_gop_has_the_format_of_the_picture_before_it(*, own: bool) -> None:
    stream_format = PerCameraStreamFormat() if own else StreamFormat()
    cameras = list(ENCODINGS) if own else list(ENCODINGS)[:1] * 2
    frame_buffers = {camera: FrameBuffer(FPS, 99, stream_format) for camera in cameras}
    for camera, frame_buffer in frame_buffers.items():
        for unit in sent_units(camera):
            frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key)
    shown: list[EncodedPicture] = stream_format.blank(None, 0, GOP, FPS)
    for gop, camera in enumerate([cameras[0], None, cameras[1], None, cameras[0]], start=1):
        first = gop * GOP
        newest = shown[-1]
        shown += (
            stream_format.blank(newest, first, GOP, FPS)
            if camera is None
            else frame_buffers[camera].pictures(first, GOP)
        )
        if camera is None:
            assert shown[-1].parameters == newest.parameters
    assert stream_format.parameters is not None
    data = b"".join([
        init_segment(stream_format.parameters, WIDTH, HEIGHT),
        *(picture.fragment for picture in shown),
    ])  # fmt: skip
    with av.open(io.BytesIO(data), "r") as stream:
        pictures = [frame.to_ndarray(format="yuv420p") for frame in stream.decode(video=0)]
    assert len(pictures) == 6 * GOP
    assert [is_gray(picture) for picture in pictures[::GOP]] == [True, False, True, False, True, False]
    assert [is_gray(picture) for picture in pictures[GOP - 1 :: GOP]] == [
        True,
        False,
        True,
        False,
        True,
        False,
    ]


def with_explicit_order(parameters: H264ParameterSets) -> H264ParameterSets:
    """Change baseline parameter sets so that each picture has a display order count."""
    sps = BitWriter()
    sps.u(8, 66)
    sps.u(16, int.from_bytes(parameters.sps[2:4], "big"))
    for value in (0, 0, 0, 4, 1):  # id, frame_num of 4 bits, order by numbers of 8 bits, one reference
        sps.ue(value)
    sps.u(1, 0)
    sps.ue(WIDTH // 16 - 1)
    sps.ue(HEIGHT // 16 - 1)
    sps.u(1, 1)
    for value in (1, 0, 0):  # direct_8x8_inference, no cropping, no VUI
        sps.u(1, value)
    sps.u(1, 1)
    sps.align(0)
    return H264ParameterSets(escape_payload(b"\x67", sps.to_bytes()), parameters.pps)


def test_one_gray_picture_lasts_for_the_gop_where_none_can_be_repeated() -> None:
    parameters = parameter_sets(nal_units(encoded((WIDTH, HEIGHT), "ultrafast", 1)[0].data))
    assert parameters is not None
    stream_format = StreamFormat()
    stream_format.adopt_or_check(with_explicit_order(parameters))
    [gray] = stream_format.blank(None, 10, 5, FPS)
    assert (gray.pulse, gray.until, gray.key) == (10, 15, True)
    assert all(map(is_gray, decoded([gray.sample, stream_format.blank(gray, 15, 5, FPS)[0].sample])))


def test_an_unsupported_format_has_no_gray_picture() -> None:
    stream_format = StreamFormat()
    assert stream_format.blank(None, 0, 5, FPS) == []
    stream_format.adopt_or_check(H264ParameterSets(b"\x67\x00\x00\x00", b"\x68"))
    assert stream_format.blank(None, 0, 5, FPS) == []


@settings(deadline=None)  # some claim to be very large
@given(st.binary(min_size=4, max_size=30), st.binary(min_size=1, max_size=10), st.integers(0, 1))
def test_parameter_sets_of_arbitrary_bytes_are_used_or_unsupported(
    sps: bytes, pps: bytes, number: int
) -> None:
    with contextlib.suppress(UnsupportedParametersError):
        assert gray_picture(H264ParameterSets(sps, pps), number)


def test_a_gray_gop_of_vp8_has_no_gap() -> None:
    stream_format: Any = Vp8StreamFormat(WIDTH, HEIGHT)
    pictures = stream_format.blank(None, 10, 5, FPS)
    assert [(picture.pulse, picture.until, picture.key) for picture in pictures] == [
        (n, n + 1, n == 10) for n in range(10, 15)
    ]
