"""A repeat picture shows the one before it again, and the stream continues after it."""

from __future__ import annotations

import contextlib
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.media.h264 import PRESETS, decoded, encoded, slice_header_format
from server.media.bitstream import BitReader, BitWriter, escape_payload, unescape_payload
from server.media.h264.annexb import H264ParameterSets, join_sample
from server.media.h264.repeat_picture import parse_repeatable
from server.media.nal_units import nal_units
from server.media.parameter_sets import UnsupportedParametersError


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(PRESETS),
    st.tuples(st.integers(1, 40), st.integers(1, 24)),
    st.integers(1, 6),
    st.integers(1, 40),
)
def test_the_last_picture_is_shown_for_as_long_as_it_is_repeated(
    preset: str, blocks: tuple[int, int], shown: int, repeats: int
) -> None:
    units = encoded((16 * blocks[0], 16 * blocks[1] + 2), preset, 7)
    writer = slice_header_format(units[0])
    samples = [join_sample(nal_units(unit.data)) for unit in units]
    numbers = [writer.frame_num(samples[shown - 1])]
    for _ in range(repeats):
        numbers.append(writer.next_num(numbers[-1]))
    filled = [
        *samples[:shown],
        *(writer.repeat(number, reference=True) for number in numbers[1:]),
        samples[6],
    ]
    pictures, alone = decoded(filled), decoded(samples)
    assert len(pictures) == shown + repeats + 1
    for place, picture in enumerate(pictures):
        expected = 6 if place == shown + repeats else min(place, shown - 1)
        np.testing.assert_array_equal(picture, alone[expected])


@settings(max_examples=10, deadline=None)
@given(st.sampled_from(PRESETS), st.sets(st.integers(1, 5), min_size=1))
def test_a_picture_can_be_inserted_between_two_of_a_camera(preset: str, before: set[int]) -> None:
    units = encoded((64, 48), preset, 6)
    writer = slice_header_format(units[0])
    alone = decoded([join_sample(nal_units(unit.data)) for unit in units])
    samples, expected = [], []
    for place, unit in enumerate(units):
        data = join_sample(nal_units(unit.data))
        if place in before:
            samples.append(writer.repeat(writer.frame_num(data), reference=False))
            expected.append(place - 1)
        samples.append(data)
        expected.append(place)
    for picture, place in zip(decoded(samples), expected, strict=True):
        np.testing.assert_array_equal(picture, alone[place])


def test_frame_num_counts_from_each_keyframe() -> None:
    units = encoded((64, 48), "ultrafast", 45, gop=40)
    writer = slice_header_format(units[0])
    numbers = [writer.frame_num(join_sample(nal_units(unit.data))) for unit in units]
    assert numbers[0] == numbers[40] == 0
    assert all(later == writer.next_num(earlier) for earlier, later in pairwise(numbers[:40]))


def test_a_sample_without_a_picture_has_no_frame_num() -> None:
    with pytest.raises(ValueError, match="contains no picture"):
        slice_header_format(encoded((64, 48), "ultrafast", 1)[0]).frame_num(b"\x00\x00\x00\x02\x06\x05")


@given(st.binary(min_size=4, max_size=30), st.binary(min_size=1, max_size=10))
def test_parameter_sets_of_arbitrary_bytes_are_parsed_or_unsupported(sps: bytes, pps: bytes) -> None:
    with contextlib.suppress(UnsupportedParametersError):
        assert parse_repeatable(H264ParameterSets(sps, pps)).macroblocks > 0


@given(st.lists(st.tuples(st.sampled_from("us"), st.integers(0, 2**20)), max_size=20))
def test_numbers_are_read_as_they_were_written(numbers: list[tuple[str, int]]) -> None:
    writer = BitWriter()
    for kind, number in numbers:
        writer.ue(number) if kind == "u" else writer.se(number - 2**19)
    writer.align(1)
    reader = BitReader(writer.to_bytes())
    for kind, number in numbers:
        assert (reader.ue() if kind == "u" else reader.se() + 2**19) == number


@given(st.lists(st.sampled_from(b"\x00\x01\x03\x80"), min_size=1, max_size=40).map(bytes))
def test_an_escaped_payload_contains_no_start_code(payload: bytes) -> None:
    unit = escape_payload(b"\x01", payload)
    assert not any(code in unit for code in (b"\x00\x00\x00", b"\x00\x00\x01", b"\x00\x00\x02"))
    assert unescape_payload(unit) == payload
