"""A spliced stream decodes to the cameras' own pixels, each at the time of its pulse."""

from __future__ import annotations

import io
from fractions import Fraction

import av
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.media.containers.fmp4 import FragmentSample, fragment, init_segment, shift_fragment, ticks
from server.media.h264.annexb import NAL_AUD, join_sample, nal_type, parameter_sets
from server.media.nal_units import nal_units, split_sample

SITE = SiteSettings(width=64, height=48, fps=25)
GOP = 4


def picture(seed: int) -> NDArray[np.uint8]:
    """Return a smooth picture that is different for every seed."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 255, (6, 8, 3), dtype=np.uint8)
    return np.repeat(np.repeat(coarse, 8, axis=0), 8, axis=1)


def encoded(first: int, frames: int, seed: int = 0, crf: int = 23) -> list[AccessUnit]:
    encoder = Encoder(SITE, EncodeSettings(gop_s=GOP / SITE.fps, crf=crf))
    return [encoder.encode(pulse, picture(1000 * seed + pulse)) for pulse in range(first, first + frames)]


def as_fragment(unit: AccessUnit) -> bytes:
    return fragment([FragmentSample(join_sample(nal_units(unit.data)), unit.key)], unit.pulse, SITE.fps)


def mp4(units: list[AccessUnit]) -> bytes:
    parameters = parameter_sets(nal_units(units[0].data))
    assert parameters is not None
    head = init_segment(parameters, SITE.width, SITE.height)
    return head + b"".join(as_fragment(unit) for unit in units)


def decoded_mp4(data: bytes) -> list[tuple[Fraction, NDArray[np.uint8]]]:
    with av.open(io.BytesIO(data)) as container:
        return [
            (frame.pts * frame.time_base, frame.to_ndarray(format="yuv420p"))
            for frame in container.decode(video=0)
        ]


def decoded_alone(units: list[AccessUnit]) -> list[NDArray[np.uint8]]:
    decoder = av.CodecContext.create("h264", "r")
    frames = []
    for unit in units:
        frames += decoder.decode(av.Packet(unit.data))
    frames += decoder.decode(None)
    return [frame.to_ndarray(format="yuv420p") for frame in frames]


def test_every_access_unit_is_encoded_at_once_and_gops_begin_at_their_pulses() -> None:
    units = encoded(first=6, frames=10)
    assert all(unit.data for unit in units), "no delay in the encoder"
    assert [unit.pulse for unit in units if unit.key] == [6, 8, 12]
    for unit in units:
        kinds = {nal_type(nal) for nal in nal_units(unit.data)}
        assert ({7, 8, 5} <= kinds) == unit.key


def test_a_stream_of_fragments_decodes_to_the_cameras_own_pixels_at_its_pulses() -> None:
    units = encoded(first=1_000_000, frames=12)
    frames = decoded_mp4(mp4(units))
    assert [time for time, _ in frames] == [Fraction(unit.pulse, 25) for unit in units]
    for (_, spliced), alone in zip(frames, decoded_alone(units), strict=True):
        np.testing.assert_array_equal(spliced, alone)


def test_a_cut_shows_the_other_cameras_own_pixels() -> None:
    one, two = encoded(0, 12, seed=1), encoded(0, 12, seed=2)
    spliced = decoded_mp4(mp4(one[:4] + two[4:8] + one[8:]))
    alone = [decoded_alone(one), decoded_alone(two)]
    for pulse, (_, frame) in enumerate(spliced):
        np.testing.assert_array_equal(frame, alone[1 if 4 <= pulse < 8 else 0][pulse])


def test_parameter_sets_are_equal_in_all_cameras_and_differ_with_the_settings() -> None:
    sets = [parameter_sets(nal_units(encoded(first, 1, seed)[0].data)) for first, seed in [(0, 1), (8, 2)]]
    assert sets[0] == sets[1]
    assert parameter_sets(nal_units(encoded(0, 1, crf=30)[0].data)) != sets[0]


def test_rebased_fragments_begin_at_time_zero() -> None:
    units = encoded(first=200, frames=4)
    parameters = parameter_sets(nal_units(units[0].data))
    assert parameters is not None
    head = init_segment(parameters, SITE.width, SITE.height)
    moved = [shift_fragment(as_fragment(unit), -ticks(200, SITE.fps)) for unit in units]
    assert [time for time, _ in decoded_mp4(head + b"".join(moved))] == [Fraction(n, 25) for n in range(4)]


@given(st.lists(st.binary(min_size=1, max_size=20), min_size=1, max_size=6), st.booleans())
def test_nal_units_split_as_they_were_joined(payloads: list[bytes], long_codes: bool) -> None:
    # Emulation prevention (7.4.1.1) keeps start codes out of units; units end in a non-zero byte.
    units = [payload.replace(b"\x00", b"\x11") for payload in payloads]
    code = b"\x00\x00\x00\x01" if long_codes else b"\x00\x00\x01"
    assert nal_units(b"".join(code + unit for unit in units)) == units


@settings(max_examples=300)
@given(st.binary(max_size=200))
def test_splitting_arbitrary_bytes_raises_no_error(data: bytes) -> None:
    units = nal_units(data)
    parameter_sets(units)
    assert len(join_sample(units)) <= len(data) + len(units)  # a 4-byte length replaces at least 3 bytes


@given(st.floats(1, 120), st.integers(0, 10**9))
def test_ticks_rise_with_every_pulse(fps: float, pulse: int) -> None:
    assert ticks(pulse + 1, fps) > ticks(pulse, fps)


UNITS = st.binary(min_size=1, max_size=9).filter(lambda unit: nal_type(unit) != NAL_AUD)


@given(st.lists(UNITS), st.binary(max_size=9))
def test_a_sample_splits_into_its_units_and_junk_is_left_out(units: list[bytes], junk: bytes) -> None:
    assert split_sample(join_sample(units)) == units
    assert split_sample(join_sample(units) + junk)[: len(units)] == units
