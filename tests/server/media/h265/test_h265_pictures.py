"""Written H.265 pictures repeat the one before, or are gray, whatever the encoder's settings."""

from __future__ import annotations

import contextlib
from functools import cache
from itertools import pairwise

import av
import numpy as np
import pytest
from av.codec.context import ThreadType
from av.video.codeccontext import VideoCodecContext
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.media.h265 import DEPTH_10, decoded_h265, sets_of, x265_units
from server.media.arithmetic_coder import ArithmeticEncoder
from server.media.bitstream import BitWriter
from server.media.h265.codec import H265
from server.media.h265.nal import NAL_IDR_N_LP, NAL_TRAIL_R, join_sample
from server.media.h265.parameter_sets import H265ParameterSets
from server.media.h265.reference_sets import Reference
from server.media.h265.repeat_picture import can_insert, repeat_after, repeat_between
from server.media.h265.slice_data import skipped_blocks
from server.media.h265.slice_header import PictureOrder, read_picture_order, write_intra, write_repeat
from server.media.nal_units import join_units, nal_units, split_sample
from server.media.parameter_sets import UnsupportedParametersError

SETTINGS = [
    "wpp=0",
    "wpp=1",
    "wpp=1:ctu=16",
    "ctu=16:max-tu-size=8",
    "ctu=32:min-cu-size=16",
    "no-sao=1",
    "sao=1:no-deblock=1",
    "ref=1",
    "ref=5",
    "temporal-layers=2",
    "tu-intra-depth=3:tu-inter-depth=3",
    "cu-lossless=1:lossless=1",
    "weightp=1",
    "constrained-intra=1:tskip=1",
    "scaling-list=default",
]
SIZES = [(64, 48), (200, 130), (360, 288)]
FRAMES = 6


@cache
def samples(size: tuple[int, int], parameters: str, preset: str, pixels: str) -> tuple[bytes, ...]:
    units = x265_units(size, FRAMES, parameters, preset, pixels)
    return tuple(join_sample(nal_units(unit)) for unit in units)


def check_written_pictures(size: tuple[int, int], parameters: str, preset: str, pixels: str) -> None:
    sent = list(samples(size, parameters, preset, pixels))
    sets = sets_of(x265_units(size, 1, parameters, preset, pixels)[0])
    alone, syntax, shown = decoded_h265(sent), sets.syntax, 4
    assert len(alone) == FRAMES
    count = read_picture_order(sent[shown - 1], syntax).count
    repeats = [repeat_after(syntax, count + number) for number in range(3)]
    gray = H265.gray_picture(sets, 0)
    pictures = decoded_h265([*sent[:shown], *repeats, *sent, gray, repeat_after(syntax, 0), gray, *sent])
    expected = [*alone[:shown], *[alone[shown - 1]] * 3, *alone, *[None] * 3, *alone]
    assert len(pictures) == len(expected)
    for picture, wanted in zip(pictures, expected, strict=True):
        if wanted is None:
            assert (picture == (512 if pixels == DEPTH_10 else 128)).all()
        else:
            np.testing.assert_array_equal(picture, wanted)


@pytest.mark.parametrize("parameters", SETTINGS)
def test_repeats_and_gray_pictures_decode_whatever_the_encoders_settings(parameters: str) -> None:
    check_written_pictures((200, 130), parameters, "ultrafast", "yuv420p")


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("preset", "pixels"), [("medium", "yuv420p"), ("superfast", DEPTH_10)])
def test_repeats_and_gray_pictures_decode_at_any_size(
    size: tuple[int, int], preset: str, pixels: str
) -> None:
    check_written_pictures(size, "wpp=1:ctu=32", preset, pixels)


@settings(max_examples=15, deadline=None)
@given(st.tuples(st.integers(2, 90), st.integers(2, 60)), st.sampled_from(SETTINGS[:5]))
def test_pictures_whose_edges_cut_blocks_decode(blocks: tuple[int, int], parameters: str) -> None:
    check_written_pictures((8 * blocks[0], 8 * blocks[1]), parameters, "ultrafast", "yuv420p")


def test_a_lost_picture_that_nothing_refers_to_is_replaced_within_its_gop() -> None:
    """As of a camera that encodes every second picture for nobody's reference (SVC)."""
    sent = list(samples((200, 130), "wpp=1:ctu=32", "ultrafast", "yuv420p"))[:2]
    syntax = sets_of(x265_units((200, 130), 1, "wpp=1:ctu=32")[0]).syntax
    second_last = (Reference(-2, used=True),)
    later = [
        join_units([write_repeat(syntax, NAL_TRAIL_R, count, second_last, skipped_blocks(syntax))])
        for count in (3, 5)
    ]
    orders = [read_picture_order(sample, syntax) for sample in (sent[1], *later)]
    assert all(can_insert(syntax, *pair) for pair in pairwise(orders))
    between = [repeat_between(syntax, *pair) for pair in pairwise(orders)]
    pictures = decoded_h265([*sent, between[0], later[0], between[1], later[1]])
    assert len(pictures) == FRAMES
    for picture in pictures[2:]:
        np.testing.assert_array_equal(picture, pictures[1])


def test_nothing_is_inserted_where_the_next_picture_could_not_be_decoded() -> None:
    syntax = sets_of(x265_units((64, 48), 1)[0]).syntax

    def allowed(count: int, *distances: int, long_term: bool = False) -> bool:
        references = tuple(Reference(distance, used=True) for distance in distances)
        return can_insert(syntax, PictureOrder(4), PictureOrder(count, references, long_term))

    assert allowed(6, -2)
    assert not allowed(6, -1), "its reference is missing"
    assert not allowed(7, -3, -2), "one of its references is missing"
    assert not allowed(5, -1), "no number is left between"
    assert not allowed(6, -2, long_term=True)
    assert not allowed(9, *range(-5, -20, -1)), "more pictures than a decoder keeps"


def test_the_order_count_wraps_around() -> None:
    syntax = sets_of(x265_units((64, 48), 1)[0]).syntax
    most = (1 << syntax.sequence.order_bits) - 1
    assert can_insert(syntax, PictureOrder(most), PictureOrder(1, (Reference(-2, used=True),)))


def test_a_sample_without_a_picture_has_no_order() -> None:
    syntax = sets_of(x265_units((64, 48), 1)[0]).syntax
    with pytest.raises(ValueError, match="contains no picture"):
        read_picture_order(b"\x00\x00\x00\x03\x4e\x01\x05", syntax)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=60), st.integers(0, 60), st.binary(max_size=3))
def test_damaged_parameter_sets_are_used_or_unsupported(noise: bytes, at: int, inserted: bytes) -> None:
    found = sets_of(_KEYFRAME)
    for sps, pps in (
        (noise, found.pps),
        (found.sps, noise),
        (found.sps[:at] + inserted + found.sps[at + len(inserted) :], found.pps),
        (found.sps, found.pps[:at] + inserted + found.pps[at + len(inserted) :]),
    ):
        damaged = H265ParameterSets(found.vps, sps, pps)
        if len(sps) > 20:
            assert damaged.codec.startswith("hvc1.")
            assert damaged.configuration
        with contextlib.suppress(UnsupportedParametersError):
            assert H265.gray_picture(damaged, 0)
        with contextlib.suppress(UnsupportedParametersError):
            H265.gap_filler(damaged, 25)


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 40), st.binary(max_size=30))
def test_damaged_pictures_are_read_or_refused(at: int, noise: bytes) -> None:
    syntax = sets_of(_KEYFRAME).syntax
    with contextlib.suppress(ValueError):
        order = read_picture_order(_PICTURE[:at] + noise + _PICTURE[at + len(noise) :], syntax)
        can_insert(syntax, PictureOrder(0), order)


def test_entry_points_count_emulation_prevention_bytes() -> None:
    """A decoder of rows in parallel needs the sizes of substreams as they are in the unit."""
    substreams = [b"\x00\x00\x01\x80", b"\x00\x00\x00\x00\x80", b"\x05\x80"]
    syntax = sets_of(x265_units((200, 130), 1, "wpp=1:ctu=64")[0]).syntax
    unit = write_intra(syntax, NAL_IDR_N_LP, substreams)
    header = "".join(f"{byte:08b}" for byte in unit[2:6])
    sizes = (5, 6)  # one byte more each
    assert "011" + "011" + "".join(f"{size - 1:03b}" for size in sizes) in header


@pytest.mark.parametrize("size", [(1280, 720), (256, 720)])
def test_rows_of_blocks_decode_in_parallel(size: tuple[int, int]) -> None:
    sets = sets_of(x265_units(size, 1, "wpp=1:ctu=64")[0])
    assert sets.syntax.picture.wavefront
    decoder = av.CodecContext.create("hevc", "r")
    assert isinstance(decoder, VideoCodecContext)
    decoder.thread_type, decoder.thread_count = ThreadType.SLICE, 4
    samples = [H265.gray_picture(sets, 0), *(repeat_after(sets.syntax, count) for count in range(3))]
    units = [b"".join(b"\x00\x00\x00\x01" + unit for unit in split_sample(sample)) for sample in samples]
    pictures = [picture for unit in [*map(av.Packet, units), None] for picture in decoder.decode(unit)]
    assert len(pictures) == 4
    assert all((picture.to_ndarray() == 128).all() for picture in pictures)


@given(st.lists(st.integers(0, 1), min_size=1, max_size=80))
def test_equally_probable_bits_take_a_bit_each(values: list[int]) -> None:
    bits = BitWriter()
    coder = ArithmeticEncoder(bits)
    for value in values:
        coder.bypass(value)
    coder.terminate(end=True)
    assert len(values) < len(bits.text) <= len(values) + 12


_KEYFRAME, _PICTURE = x265_units((64, 48), 2)
_PICTURE = join_sample(nal_units(_PICTURE))
