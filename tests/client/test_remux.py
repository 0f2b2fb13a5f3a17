"""Remuxing of a recording: unchanged pictures and sound from time 0, complete or not at all."""

from __future__ import annotations

from pathlib import Path

import av
import pytest

from client.media_stream import MediaStreamError
from client.remux import remux
from fakes.media.audio import access_units, decode_audio, packets, write_flashes
from fakes.service.scripted_cameras import HEIGHT, WIDTH, encoded
from fakes.system.full_disk import files_of_at_most
from server.media.audio.aac import SAMPLES
from server.media.audio.audio_format import AudioFormat
from server.media.containers.mp4_audio import audio_fragment
from server.media.h265.codec import H265
from server.media.stream_format import PerCameraStreamFormat, StreamFormat

FPS, RATE = 25, 48_000
START = 8000
"""The pulse of the first picture; a frame of sound begins with it."""
FIRST_SOUND = START * RATE // FPS // SAMPLES
PICTURES = 40


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_flashes(tmp_path_factory.mktemp("remux") / "flashes.mp4", PICTURES)


def write_stream(part: Path, source: Path, lost: range = range(0), early: int = 0, late: int = 0) -> Path:
    """Write a stream whose audio begins some frames before the pictures and ends some after them."""
    stream_format, sound = StreamFormat(), AudioFormat(RATE, 2)
    units = access_units(source)
    stream_format.accept(units[0].data)
    frames = packets(source.read_bytes())
    count = PICTURES * RATE // FPS // SAMPLES
    frames = [frames[number % len(frames)] for number in range(early + count + late)]
    head = stream_format.init_segment((64, 48), FPS, sound)
    assert head is not None
    pictures = [stream_format.pack(unit.data, START + unit.pulse, FPS, key=unit.key) for unit in units]
    kept = [picture for number, picture in enumerate(pictures) if number not in lost]
    part.write_bytes(head + audio_fragment(sound, frames, FIRST_SOUND - early) + b"".join(kept))
    return part


def test_a_gap_prolongs_the_picture_before_it(source: Path, tmp_path: Path) -> None:
    part, out = write_stream(tmp_path / "part", source, lost=range(10, 20)), tmp_path / "film.mp4"
    remux(part, out, "mp4")
    with av.open(str(out)) as film:
        shown = [(packet.pts, packet.duration) for packet in film.demux(video=0) if packet.pts is not None]
        ticks = round(1 / FPS / film.streams.video[0].time_base)
        assert film.duration == PICTURES * av.time_base // FPS
    times = [number * ticks for number in range(PICTURES) if number not in range(10, 20)]
    assert shown == [(time, ticks * (11 if time == 9 * ticks else 1)) for time in times]


def test_pictures_and_sound_are_copied_byte_for_byte(source: Path, tmp_path: Path) -> None:
    part, out = write_stream(tmp_path / "part", source), tmp_path / "film.mp4"
    remux(part, out, "mp4")
    with av.open(str(part)) as stream, av.open(str(out)) as film:
        before, after = ([bytes(packet) for packet in file.demux(video=0)] for file in (stream, film))
    assert after == before
    assert packets(out.read_bytes()) == packets(part.read_bytes())


@pytest.mark.parametrize(("early", "late"), [(0, 0), (5, 0), (-5, 0), (0, 30)])
def test_sound_stays_with_its_pictures(source: Path, tmp_path: Path, early: int, late: int) -> None:
    out = tmp_path / "film.mp4"
    remux(write_stream(tmp_path / "part", source, early=early, late=late), out, "mp4")
    with av.open(str(out)) as film:
        assert film.streams.video[0].start_time == 0
        assert film.duration == PICTURES * av.time_base // FPS, "sound after the last picture is left out"
    times, _ = decode_audio(out.read_bytes())
    assert times[0] == pytest.approx(max(0, -early) * SAMPLES / RATE, abs=0.001)
    assert times[-1] <= PICTURES / FPS + SAMPLES / RATE


def test_a_sound_track_without_sound_is_left_out(source: Path, tmp_path: Path) -> None:
    out = tmp_path / "film.mp4"
    remux(write_stream(tmp_path / "part", source, early=-1000, late=1000), out, "mp4")
    with av.open(str(out)) as film:
        assert [stream.type for stream in film.streams] == ["video"]


def test_a_disk_without_room_for_all_of_it_is_always_reported(source: Path, tmp_path: Path) -> None:
    part, out = write_stream(tmp_path / "part", source), tmp_path / "film.mp4"
    remux(part, out, "mp4")
    size = out.stat().st_size
    for limit in (0, 1, *range(100, size, 997), size - 1):
        with files_of_at_most(limit), pytest.raises(OSError, match="File too large"):
            remux(part, out, "mp4")
    with files_of_at_most(size):
        remux(part, out, "mp4")


@pytest.mark.parametrize("content", [b"", b"#EXTM3U\n#EXTINF:1,\nother.mp4\n", bytes(1000)])
def test_an_invalid_stream_is_refused(tmp_path: Path, content: bytes) -> None:
    part = tmp_path / "part"
    part.write_bytes(content)
    for container in ("mp4", "webm"):
        with pytest.raises(MediaStreamError):
            remux(part, tmp_path / "film", container)


@pytest.mark.parametrize("entry", ["hvc1", "hev1"])
def test_h265_keeps_its_pictures_and_its_sample_entry(tmp_path: Path, entry: str) -> None:
    stream_format = StreamFormat(H265) if entry == "hvc1" else PerCameraStreamFormat(H265)
    units = encoded(0, codec="h265")
    stream_format.accept(units[0].data)
    head = stream_format.init_segment((WIDTH, HEIGHT), FPS)
    assert head is not None
    part, out = tmp_path / "part", tmp_path / "film.mp4"
    part.write_bytes(
        head
        + b"".join(stream_format.pack(unit.data, START + unit.pulse, FPS, key=unit.key) for unit in units)
    )
    remux(part, out, "mp4")
    with av.open(str(part)) as stream, av.open(str(out)) as film:
        before, after = ([bytes(packet) for packet in file.demux(video=0)] for file in (stream, film))
        assert film.streams.video[0].codec_context.codec_tag == entry
    assert after == before
