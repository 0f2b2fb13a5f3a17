"""The gateway's reader of fragmented MP4: samples as written, however the bytes are cut."""

from __future__ import annotations

import contextlib
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.media.h265 import sets_of, x265_units
from fakes.service.scripted_cameras import FPS, HEIGHT, WIDTH, encoded
from server.media.audio.audio_format import AudioFormat
from server.media.containers.fmp4 import FragmentSample, fragment, init_segment, still_fragment
from server.media.containers.mp4_audio import audio_fragment
from server.media.h264.annexb import join_sample, parameter_sets
from server.media.h265.nal import is_idr
from server.media.nal_units import join_units, nal_units, split_sample
from server.rtsp.mp4_reader import Head, Mp4Error, Mp4Reader, Sample, Track, with_parameter_sets

UNITS = encoded(0, 10)
SAMPLES = [join_sample(nal_units(unit.data)) for unit in UNITS]
FRAMES = [bytes([number]) * (number + 1) for number in range(6)]


def stream(audio: AudioFormat | None = None) -> bytes:
    parameters = parameter_sets(nal_units(UNITS[0].data))
    assert parameters is not None
    parts = [init_segment(parameters, WIDTH, HEIGHT, audio)]
    if audio is not None:
        parts.append(audio_fragment(audio, FRAMES, 50))
    parts += [
        fragment([FragmentSample(sample, unit.key)], 100 + unit.pulse, FPS)
        for unit, sample in zip(UNITS, SAMPLES, strict=True)
    ]
    return b"".join(parts)


@given(st.lists(st.integers(0, len(stream()))))
def test_samples_are_as_written_however_the_bytes_are_cut(cuts: list[int]) -> None:
    reader, data, edges = Mp4Reader(), stream(), sorted({0, *cuts, len(stream())})
    parts = [part for begin, end in pairwise(edges) for part in reader.feed(data[begin:end])]
    assert isinstance(parts[0], Head)
    samples = [part for part in parts if isinstance(part, Sample)]
    assert [sample.data for sample in samples] == SAMPLES
    assert [sample.is_key for sample in samples] == [unit.key for unit in UNITS]
    assert [sample.time_s for sample in samples] == pytest.approx([4 + n / FPS for n in range(10)])
    assert [sample.duration_s for sample in samples] == pytest.approx([1 / FPS] * 10)


@pytest.mark.parametrize("coding", ["aac", "opus"])
def test_audio_has_its_configuration_and_exact_times(coding: str) -> None:
    audio = AudioFormat(48_000, 2, coding)  # type: ignore[arg-type]
    head, *samples = Mp4Reader().feed(stream(audio))
    assert isinstance(head, Head)
    (track,) = (track for track in head.tracks if not track.is_video)
    assert (track.codec, track.rate, track.channels) == (coding, 48_000, 2)
    assert track.configuration == (audio.aac_config if coding == "aac" else b"")
    frames = [sample for sample in samples if isinstance(sample, Sample) and sample.track == track]
    assert [frame.data for frame in frames] == FRAMES
    assert frames[1].time_s == pytest.approx(51 * audio.samples / 48_000)


def test_a_fragment_of_several_samples_is_split() -> None:
    samples = [FragmentSample(SAMPLES[0], key=True), FragmentSample(SAMPLES[1], key=False)]
    reader = Mp4Reader()
    list(reader.feed(stream()[: stream().index(b"moof") - 4]))
    first, second = reader.feed(still_fragment(samples, 0, 10, FPS))
    assert isinstance(first, Sample)
    assert isinstance(second, Sample)
    assert (first.is_key, second.is_key) == (True, False)
    assert second.time_s + second.duration_s == pytest.approx(10 / FPS)


@given(st.integers(0, len(stream()) - 1), st.binary(min_size=1, max_size=8))
def test_damaged_bytes_are_an_error_or_other_samples(at: int, damage: bytes) -> None:
    data = bytearray(stream(AudioFormat(48_000, 2)))
    data[at : at + len(damage)] = damage
    with contextlib.suppress(Mp4Error):
        list(Mp4Reader().feed(bytes(data)))


@given(st.binary(max_size=400))
def test_any_bytes_are_an_error_or_wait_for_more(data: bytes) -> None:
    with contextlib.suppress(Mp4Error):
        list(Mp4Reader().feed(data))


def test_a_keyframe_has_its_parameter_sets_once_before_all_slices() -> None:
    head, *_ = Mp4Reader().feed(stream())
    assert isinstance(head, Head)
    (track,) = head.tracks
    parameters = parameter_sets(nal_units(UNITS[0].data))
    assert parameters is not None
    slices = [b"\x65first", b"\x65second"]
    sample = b"".join(len(nal).to_bytes(4, "big") + nal for nal in slices)
    whole = with_parameter_sets(sample, track)
    assert list(split_sample(whole)) == [parameters.sps, parameters.pps, *slices]
    assert with_parameter_sets(whole, track) == whole, "avc3 has its own"


def test_a_keyframe_of_h265_has_its_parameter_sets_once() -> None:
    (unit,) = x265_units((64, 48), 1)
    sets = sets_of(unit)
    head, *_ = Mp4Reader().feed(init_segment(sets, 64, 48))
    assert isinstance(head, Head)
    (track,) = head.tracks
    assert (track.codec, track.is_video) == ("h265", True)
    picture = join_units([one for one in nal_units(unit) if is_idr(one)])
    whole = with_parameter_sets(picture, track)
    assert split_sample(whole)[:3] == [sets.vps, sets.sps, sets.pps]
    assert with_parameter_sets(whole, track) == whole


@given(st.sampled_from(["h264", "h265"]), st.binary(max_size=40), st.binary(max_size=40))
def test_any_configuration_is_an_error_or_ignored(codec: str, sample: bytes, configuration: bytes) -> None:
    with contextlib.suppress(Mp4Error):
        with_parameter_sets(sample, Track(1, 90_000, codec, configuration))
