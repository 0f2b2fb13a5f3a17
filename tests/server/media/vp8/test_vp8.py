"""VP8 in WebM: repeated pictures, independent clusters, and cameras of another format."""

from __future__ import annotations

import io
import subprocess
from functools import cache
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fakes.programs import needs_ffprobe
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.media.containers.webm import cluster, header, shift_cluster
from server.media.picture import EncodedPicture
from server.media.stream_format import ParameterMismatchError
from server.media.vp8.repeat_frame import repeat_frame
from server.media.vp8.stream_format import Vp8StreamFormat, keyframe_size
from server.service.rendering.decided_boxes import first_pulse
from server.service.rendering.worker.demuxers import demux_webm
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.gapless_timeline import GaplessTimeline

FPS, GOP, FRAMES = 25.0, 5, 20
Pixels = NDArray[np.uint8]
sides = st.integers(8, 60).map(lambda half: 2 * half)


@cache
def encoded(width: int, height: int, missed: frozenset[int] = frozenset()) -> tuple[AccessUnit, ...]:
    """Encode pictures that move, so that frames build on the ones before them, but for those missed."""
    encoder = Encoder(
        SiteSettings(width=width, height=height, fps=FPS), EncodeSettings(codec="vp8", gop_s=GOP / FPS)
    )
    noise = np.random.default_rng(0).integers(0, 255, (height, width, 3), dtype=np.uint8)
    captured = (pulse for pulse in range(FRAMES) if pulse not in missed)
    return tuple(encoder.encode(pulse, np.roll(noise, 3 * pulse, axis=1)) for pulse in captured)


def decoded(frames: list[bytes], decoder: str) -> list[Pixels]:
    context = av.CodecContext.create(decoder, "r")
    assert isinstance(context, av.VideoCodecContext)
    return [
        frame.to_ndarray(format="yuv420p") for data in frames for frame in context.decode(av.Packet(data))
    ]


@settings(max_examples=25, deadline=None)
@given(sides, sides, st.lists(st.integers(0, 3), min_size=FRAMES, max_size=FRAMES))
def test_a_repetition_shows_the_picture_before_and_changes_none_after(
    width: int, height: int, repeats: list[int]
) -> None:
    units, repetition = encoded(width, height), repeat_frame(width, height)
    plain = decoded([unit.data for unit in units], "vp8")
    expected = [n for n, count in enumerate(repeats) for _ in range(1 + count)]
    frames = [
        data
        for unit, count in zip(units, repeats, strict=True)
        for data in [unit.data, *[repetition] * count]
    ]
    for decoder in ("vp8", "libvpx"):  # FFmpeg's decoder, and that of browsers
        np.testing.assert_array_equal(decoded(frames, decoder), [plain[n] for n in expected], decoder)


def test_a_repetition_is_small() -> None:
    assert len(repeat_frame(640, 360)) < 100


@given(st.integers(16, 8192), st.integers(16, 8192))
def test_the_size_is_read_from_keyframes_only(width: int, height: int) -> None:
    key = b"\x10\x00\x00\x9d\x01\x2a" + width.to_bytes(2, "little") + height.to_bytes(2, "little")
    assert keyframe_size(key) == (width, height)
    assert keyframe_size(b"\x11" + key[1:]) is None
    assert keyframe_size(key[:9]) is None


def frame_buffer(width: int = 64, height: int = 48) -> FrameBuffer:
    return FrameBuffer(FPS, FRAMES, Vp8StreamFormat(width, height))


def test_a_camera_of_another_size_or_codec_is_refused() -> None:
    other = encoded(96, 48)[0]
    with pytest.raises(ParameterMismatchError, match="not VP8 of the site's size"):
        frame_buffer().put(0, 1, other.data, key=True)
    h264 = Encoder(SiteSettings(width=64, height=48), EncodeSettings()).encode(
        0, np.zeros((48, 64, 3), dtype=np.uint8)
    )
    with pytest.raises(ParameterMismatchError):
        frame_buffer().put(0, 1, h264.data, key=True)


def pictures_of(units: tuple[AccessUnit, ...], boot: int = 1) -> list[EncodedPicture]:
    on = frame_buffer()
    return [on.put(unit.pulse, boot, unit.data, key=unit.key) for unit in units]


def read(data: bytes) -> list[tuple[float, Pixels]]:
    """Return the pulses and pictures of a WebM."""
    with av.open(io.BytesIO(data), format="matroska") as container:
        return [(frame.time * FPS, frame.to_ndarray(format="yuv420p")) for frame in container.decode(video=0)]


@settings(max_examples=60, deadline=None)
@given(
    st.sets(st.integers(0, FRAMES - 1), max_size=6),
    st.sets(st.integers(0, FRAMES - 1), max_size=6),
    st.integers(0, 10**6),
)
def test_a_stream_has_a_picture_for_every_pulse_despite_losses(
    missed: set[int], lost: set[int], first: int
) -> None:
    """An uncaptured frame affects no other; after a lost one the picture freezes until a keyframe."""
    first -= first % GOP
    units = {unit.pulse: unit for unit in encoded(64, 48, missed=frozenset(missed))}
    plain = dict(zip(units, decoded([unit.data for unit in units.values()], "vp8"), strict=True))
    stream_format = Vp8StreamFormat(64, 48)
    time, on = GaplessTimeline(stream_format, FPS, GOP), FrameBuffer(FPS, FRAMES, stream_format)
    shown: list[EncodedPicture] = []
    shown_at: list[int] = []
    """The pulse of the picture that is to be seen at each pulse."""
    for pulse in range(FRAMES):
        unit = None if pulse in lost else units.get(pulse)
        if unit is not None:
            reference = None if unit.reference_pulse is None else first + unit.reference_pulse
            shown += time.push(on.put(first + pulse, 1, unit.data, key=unit.key, reference_pulse=reference))
        if unit is not None and (unit.key or unit.reference_pulse in shown_at):
            shown_at.append(pulse)
        elif shown_at:
            shown_at.append(shown_at[-1])
    shown += time.fill(first + FRAMES)
    if not shown_at:
        assert not shown
        return
    pictures = read(header(64, 48, FPS) + b"".join(picture.fragment for picture in shown))
    pulses = [pulse for picture in shown for pulse in range(picture.pulse, picture.until)]
    assert pulses == list(range(first + FRAMES - len(shown_at), first + FRAMES))
    assert [round(pulse, 3) for pulse, _ in pictures] == [picture.pulse for picture in shown]
    place_of = dict(zip(pulses, shown_at, strict=True))
    np.testing.assert_array_equal(
        [picture for _, picture in pictures], [plain[place_of[picture.pulse]] for picture in shown]
    )


def test_a_long_gap_is_filled_by_one_long_picture() -> None:
    stream_format = Vp8StreamFormat(64, 48)
    time, (first, *_) = GaplessTimeline(stream_format, FPS, GOP), encoded(64, 48)
    shown = time.push(
        EncodedPicture(0, key=True, fragment=stream_format.pack(first.data, 0, FPS, key=True), boot=1)
    )
    shown += time.fill(1000)
    assert [(picture.pulse, picture.duration) for picture in shown] == [(0, 1), (1, 999)]
    data = header(64, 48, FPS) + b"".join(picture.fragment for picture in shown)
    with av.open(io.BytesIO(data), format="matroska") as container:
        packets = [packet for packet in container.demux(video=0) if packet.pts is not None]
    assert [(packet.pts, packet.duration, packet.is_keyframe) for packet in packets] == [
        (0, 40, True),
        (40, 39_960, False),
    ]


@given(st.integers(0, 2**40), st.integers(-1000, 10**9), st.sampled_from([15, 25, 29.97, 30, 50, 60]))
def test_shifting_a_cluster_changes_only_its_time(pulse: int, by: int, fps: float) -> None:
    moved = shift_cluster(cluster(b"frame", pulse, fps, key=True), max(by, 0))
    time = round(pulse * 1000 / fps) + max(0, by)
    assert moved[10:18] == time.to_bytes(8, "big")
    assert moved[:10] + moved[18:] == (whole := cluster(b"frame", pulse, fps, key=True))[:10] + whole[18:]


@given(
    st.lists(st.tuples(st.binary(min_size=1, max_size=40), st.booleans(), st.integers(1, 200)), min_size=1),
    st.integers(0, 2**40),
    st.data(),
)
def test_demuxing_returns_the_muxed_frames_and_stops_at_damage(
    frames: list[tuple[bytes, bool, int]], first: int, data: st.DataObject
) -> None:
    pulse, clusters, expected = first, b"", []
    for content, begins, duration in frames:
        key = begins and duration == 1
        clusters += cluster(content, pulse, FPS, key=key, duration=duration)
        expected.append((pulse, key, content, duration))
        pulse += duration
    assert [
        (frame.pulse, frame.key, frame.data, frame.duration) for frame in demux_webm(clusters, FPS)
    ] == expected
    assert first_pulse(clusters, FPS) == first
    list(demux_webm(clusters[: data.draw(st.integers(0, len(clusters)))], FPS))
    list(demux_webm(data.draw(st.binary(max_size=100)), FPS))


@needs_ffprobe
def test_ffprobe_reports_no_errors(tmp_path: Path) -> None:
    units = encoded(64, 48)
    data = header(64, 48, FPS, FRAMES) + b"".join(picture.fragment for picture in pictures_of(units))
    file = tmp_path / "film.webm"
    file.write_bytes(data)
    entries = "stream=codec_name,width,height,avg_frame_rate:format=format_name,duration"
    command = ["ffprobe", "-v", "warning", "-of", "default=nw=1", "-show_entries", entries, str(file)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stderr == ""
    assert set(result.stdout.split()) == {
        "codec_name=vp8",
        "width=64",
        "height=48",
        "avg_frame_rate=25/1",
        "format_name=matroska,webm",
        "duration=0.800000",
    }
