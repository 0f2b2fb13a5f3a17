"""The parameter sets of H.265 in MP4: codec string and configuration, as FFmpeg writes and reads them."""

from __future__ import annotations

import io
from dataclasses import replace

import av
import pytest

from fakes.media.h265 import DEPTH_10, sets_of, x265_units
from server.media.containers.fmp4 import FragmentSample, fragment, init_segment
from server.media.h265.nal import NAL_PPS, NAL_SPS, NAL_VPS, join_sample, nal_type
from server.media.h265.parameter_sets import parameter_sets
from server.media.nal_units import nal_units
from server.media.parameter_sets import UnsupportedParametersError


def test_the_codec_string_names_profile_tier_level_and_constraints() -> None:
    sets = sets_of(x265_units((64, 48), 1, "level-idc=3.1")[0])
    assert sets.codec == "hvc1.1.6.L93.90"
    assert replace(sets, may_change=True).codec == "hev1.1.6.L93.90"
    assert sets_of(x265_units((64, 48), 1, "level-idc=3.1", pixels=DEPTH_10)[0]).codec == "hvc1.2.4.L93.90"


@pytest.mark.parametrize("pixels", ["yuv420p", DEPTH_10])
def test_the_configuration_is_that_of_ffmpegs_muxer(pixels: str) -> None:
    units = x265_units((64, 48), 3, pixels=pixels)
    out = io.BytesIO()
    with av.open(out, "w", format="mp4") as container:
        stream = container.add_stream("libx265", rate=25, options={"x265-params": "log-level=none"})
        stream.codec_tag = "hvc1"
        stream.width, stream.height, stream.pix_fmt = 64, 48, pixels
        for number, unit in enumerate(units):
            packet = av.Packet(unit)
            packet.stream, packet.pts, packet.dts = stream, number, number
            container.mux(packet)
    box = out.getvalue().split(b"hvcC")[1]
    assert box[:22] == sets_of(units[0]).configuration[:22], "the arrays differ: x265 adds a message"


@pytest.mark.parametrize("own", [False, True])
def test_a_decoder_reads_the_stream_by_its_init_segment_alone(own: bool) -> None:
    units = x265_units((64, 48), 4)
    sets = replace(sets_of(units[0]), may_change=own)
    data = init_segment(sets, 64, 48)
    for number, unit in enumerate(units):
        kept = [one for one in nal_units(unit) if own or nal_type(one) not in (NAL_VPS, NAL_SPS, NAL_PPS)]
        data += fragment([FragmentSample(join_sample(kept), key=not number)], number, 25)
    with av.open(io.BytesIO(data)) as container:
        assert container.streams.video[0].codec_context.codec_tag == sets.entry
        assert len(list(container.decode(video=0))) == 4


def test_several_different_parameter_sets_of_a_kind_are_none() -> None:
    (unit,) = x265_units((64, 48), 1)
    (other,) = x265_units((72, 48), 1)
    units = nal_units(unit)
    assert parameter_sets(units) == parameter_sets([*units, *units])
    assert parameter_sets([*units, *nal_units(other)]) is None
    assert parameter_sets([one for one in units if nal_type(one) != NAL_VPS]) is None


def test_other_chroma_formats_are_unsupported() -> None:
    sets = sets_of(x265_units((64, 48), 1, pixels="yuv444p")[0])
    with pytest.raises(UnsupportedParametersError, match="neither Main nor Main 10"):
        assert sets.syntax
