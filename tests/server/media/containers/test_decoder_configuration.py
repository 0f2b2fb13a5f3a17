"""Decoder configuration records are read whole or refused, alike for cameras' own video and for RTSP."""

from __future__ import annotations

import contextlib
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.media.h265 import sets_of, x265_units
from fakes.service.scripted_cameras import encoded
from server.camera.passthrough.access_units import parse_packing
from server.media.codec import nal_codec
from server.media.containers.decoder_configuration import DecoderConfiguration, parse_decoder_configuration
from server.media.h264.annexb import parameter_sets
from server.media.nal_units import nal_units, split_sample
from server.rtsp.mp4_reader import Mp4Error, Track, with_parameter_sets

Kind = Literal["h264", "h265"]
KEYFRAMES = {"h264": b"\0\0\0\2\x65p", "h265": b"\0\0\0\3\x26\1p"}


def record_of(codec: Kind) -> tuple[bytes, tuple[bytes, ...]]:
    """Return a record, and its parameter sets."""
    if codec == "h265":
        h265 = sets_of(x265_units((64, 48), 1)[0])
        return h265.configuration, (h265.vps, h265.sps, h265.pps)
    h264 = parameter_sets(nal_units(encoded(0, 1)[0].data))
    assert h264 is not None
    return h264.configuration, (h264.sps, h264.pps)


@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_a_record_is_read_and_any_part_of_it_refused_by_both_users(codec: Kind) -> None:
    record, sets = record_of(codec)
    assert parse_decoder_configuration(record, codec) == DecoderConfiguration(4, sets)
    assert parse_packing(record, nal_codec(codec)).sets == sets
    sample = KEYFRAMES[codec]
    assert split_sample(with_parameter_sets(sample, Track(1, 1, codec, record)))[:-1] == list(sets)
    for end in range(1, len(record)):
        with pytest.raises(ValueError, match="box is damaged"):
            parse_packing(record[:end], nal_codec(codec))
        with pytest.raises(Mp4Error, match="box is damaged"):
            with_parameter_sets(sample, Track(1, 1, codec, record[:end]))


@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_what_follows_the_sets_and_empty_sets_do_not_matter(codec: Kind) -> None:
    record, sets = record_of(codec)
    assert parse_decoder_configuration(record + b"\xfd\xf8\xf8\0", codec).sets == sets  # of high profiles
    none = {"h264": b"\1\x42\0\x1e\xff\xe1\0\0\1\0\0", "h265": record[:22] + b"\1\x20\0\1\0\0"}
    assert parse_decoder_configuration(none[codec], codec).sets == ()


@given(st.sampled_from(["h264", "h265"]), st.binary(max_size=60))
def test_any_bytes_are_a_record_or_an_error(codec: Kind, data: bytes) -> None:
    with contextlib.suppress(ValueError):
        assert all(parse_decoder_configuration(data, codec).sets)
