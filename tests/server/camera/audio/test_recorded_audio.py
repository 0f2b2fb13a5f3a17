"""Audio of a recording: numbered AAC frames in sync with the video, passed through where compatible."""

from __future__ import annotations

import io
import wave
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Literal

import av
import cv2
import numpy as np
import pytest
from av.audio.stream import AudioStream
from hypothesis import given
from hypothesis import strategies as st

from fakes.media.audio import FLASH_INTERVAL, FPS, beeps, write_flashes
from server.camera.audio import (
    EncodedAudioFrame,
    LiveAudioSource,
    RecordedAudioSource,
    consecutive_runs,
    open_site_audio,
)
from server.camera.audio.encoder import AudioEncoder
from server.camera.audio.passthrough import AudioPassthrough
from server.camera.audio.recorded_source import _in_order
from server.config.loader import build_config
from server.config.sections import SoundSettings
from server.media.audio.audio_format import AudioFormat
from server.system.errors import UserError

FRAMES = 70
STEREO = SoundSettings(source="here")
FORM = AudioFormat(48_000, 2)


def frames_until(sound: RecordedAudioSource, pulse: int, first: int = 0) -> list[EncodedAudioFrame]:
    return [frame for number in range(first, pulse + 1) for frame in sound.until(number)]


def as_adts(frames: list[EncodedAudioFrame], form: AudioFormat) -> bytes:
    """Return the frames as a stream from frame 0 on; missing ones are silent."""
    found = {frame.number: frame.data for frame in frames}
    data = [found.get(number, form.silence) for number in range(max(found) + 1)]
    return b"".join(form.adts(len(frame)) + frame for frame in data)


def are_numbers_rising(frames: list[EncodedAudioFrame]) -> bool:
    return all(a.number < b.number for a, b in pairwise(frames))


def test_compatible_audio_is_passed_through_byte_for_byte(tmp_path: Path) -> None:
    path = write_flashes(tmp_path / "own.mp4", FRAMES)
    sound = RecordedAudioSource(str(path), STEREO, FPS, 0, "stop")
    with av.open(str(path)) as container:
        own = [
            bytes(packet)
            for packet in container.demux(audio=0)
            if packet.size and packet.pts is not None and packet.pts >= 0
        ]
    frames = frames_until(sound, FRAMES + 10)
    assert isinstance(sound._framer, AudioPassthrough)
    assert [frame.data for frame in frames] == own
    assert [frame.number for frame in frames] == list(range(len(own)))


@pytest.mark.parametrize(
    ("name", "codec", "rate", "channels"),
    [
        ("same.mp4", "aac", 48_000, 2),
        ("other.mp4", "aac", 44_100, 1),
        ("plain.wav", "pcm_s16le", 48_000, 2),
        ("opus.mkv", "libopus", 48_000, 2),
        ("mp3.mkv", "mp3", 32_000, 1),
    ],
)
@pytest.mark.parametrize("offset", [0, 7, -3])
def test_beeps_are_in_sync_with_flashes(
    tmp_path: Path, name: str, codec: str, rate: int, channels: int, offset: int
) -> None:
    path = write_flashes(
        tmp_path / name, FRAMES, codec=codec, rate=rate, channels=channels, pictures=name != "plain.wav"
    )
    sound = RecordedAudioSource(str(path), STEREO, FPS, offset, "stop")
    frames = frames_until(sound, FRAMES + 10)
    assert isinstance(sound._framer, AudioPassthrough if name == "same.mp4" else AudioEncoder)
    assert are_numbers_rising(frames)
    form = STEREO.format
    assert form is not None
    expected = [(number + offset) / FPS for number in range(FLASH_INTERVAL, FRAMES, FLASH_INTERVAL)]
    assert beeps(as_adts(frames, form), "aac") == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("codec", ["aac", "mp3"])
def test_a_looped_recording_stays_in_sync(tmp_path: Path, codec: str) -> None:
    path = write_flashes(tmp_path / "loop.mkv", FRAMES, codec=codec)
    frames = frames_until(RecordedAudioSource(str(path), STEREO, FPS, 0, "loop"), 4 * FRAMES)
    assert are_numbers_rising(frames)
    assert sum(1 for _ in consecutive_runs(frames)) <= 5, "without gaps except at the restarts"
    form = STEREO.format
    assert form is not None
    expected = [
        (n + m) / FPS
        for m in range(0, 4 * FRAMES, FRAMES)
        for n in range(FLASH_INTERVAL, FRAMES, FLASH_INTERVAL)
    ]
    assert beeps(as_adts(frames, form), "aac") == pytest.approx(expected, abs=0.03)


def test_a_loop_whose_audio_does_not_overlap_its_pictures_is_silent_and_terminates(
    tmp_path: Path,
) -> None:
    path = write_flashes(tmp_path / "loop.mkv", FRAMES)
    sound = RecordedAudioSource(str(path), STEREO, FPS, 0, "loop")
    sound._start -= 60  # the audio begins a minute after the pictures
    assert frames_until(sound, 2 * FRAMES) == []


@pytest.mark.parametrize("codec", ["aac", "mp3"])
def test_a_late_start_yields_the_same_audio_frames(tmp_path: Path, codec: str) -> None:
    path = write_flashes(tmp_path / "late.mkv", FRAMES, codec=codec)
    late = 10 * FRAMES
    frames = frames_until(RecordedAudioSource(str(path), STEREO, FPS, 0, "loop"), late + FRAMES, first=late)
    form = STEREO.format
    assert form is not None
    assert frames[0].number >= form.frame_at(late, FPS) - 48, "about a second before, not everything"
    moments = beeps(as_adts(frames, form), "aac")
    expected = [(late + n) / FPS for n in range(FLASH_INTERVAL, FRAMES, FLASH_INTERVAL)]
    assert [moment for moment in moments if moment > late / FPS] == pytest.approx(expected, abs=0.03)


def test_cover_art_does_not_affect_the_audio_times(tmp_path: Path) -> None:
    path = write_flashes(tmp_path / "plain.mp3", FRAMES, codec="mp3", pictures=False)
    cover = cv2.imencode(".jpg", np.full((60, 60, 3), 120, np.uint8))[1].tobytes()
    content = b"\0image/jpeg\0\x03\0" + cover
    head = b"APIC" + len(content).to_bytes(4, "big") + b"\0\0"  # ID3v2.3, 4.15
    size = len(head) + len(content)
    tag = b"ID3\x03\0\0" + bytes(size >> shift & 0x7F for shift in (21, 14, 7, 0))
    covered = tmp_path / "covered.mp3"
    covered.write_bytes(tag + head + content + path.read_bytes())
    with av.open(str(covered)) as container:
        assert container.streams.video
    sources = [RecordedAudioSource(str(recording), STEREO, FPS, 0, "loop") for recording in (path, covered)]
    plain, other = (beeps(as_adts(frames_until(source, 2 * FRAMES), FORM), "aac") for source in sources)
    assert len(plain) > 2
    assert other == pytest.approx(plain, abs=0.03)


def test_a_packet_with_a_time_far_ahead_does_not_silence_later_audio() -> None:
    def packet(seconds: float) -> av.Packet[AudioStream]:
        found: av.Packet[AudioStream] = av.Packet(b"sound")
        found.pts, found.time_base = round(seconds * 1000), Fraction(1, 1000)
        return found

    def times(*seconds: float) -> list[float]:
        return [float(time) for time, _ in _in_order(packet(second) for second in seconds)]

    assert times(0, 1, 3600, 2, 3) == [0, 1, 2, 3]
    assert times(0, 1, 60, 61) == [0, 1, 60, 61], "a minute without audio"
    assert times(0, 3600, 7200, 1, 2) == [0, 3600, 1, 2]


def test_audio_that_cannot_be_converted_is_silent_and_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "nine.wav"
    with wave.open(str(path), "wb") as file:
        file.setnchannels(9)
        file.setsampwidth(2)
        file.setframerate(48_000)
        file.writeframes(bytes(2 * 9 * 48_000))
    frames = frames_until(RecordedAudioSource(str(path), STEREO, FPS, 0, "stop"), FPS)
    assert beeps(as_adts(frames, FORM), "aac") == []
    (line,) = caplog.messages
    assert line.startswith("audio of 9 channels at 48000 Hz cannot be converted: ")


@pytest.mark.parametrize("fps", [12.5, 30.0])
@pytest.mark.parametrize("at_end", ["stop", "loop"])
def test_audio_is_in_sync_with_pictures_of_another_rate(
    tmp_path: Path, fps: float, at_end: Literal["stop", "loop"]
) -> None:
    path = write_flashes(tmp_path / "own.mkv", FRAMES)
    passes = 2 if at_end == "loop" else 1
    sound = RecordedAudioSource(str(path), STEREO, fps, 0, at_end)
    frames = frames_until(sound, round(passes * FRAMES / FPS * fps))
    expected = [
        (m * FRAMES + n) / FPS for m in range(passes) for n in range(FLASH_INTERVAL, FRAMES, FLASH_INTERVAL)
    ]
    assert beeps(as_adts(frames, FORM), "aac") == pytest.approx(expected, abs=0.03)


def test_sources_without_audio_are_refused(tmp_path: Path) -> None:
    path = write_flashes(tmp_path / "own.mp4", FRAMES)
    cameras = [{"id": "c0", "source": str(path)}, {"id": "c1", "source": "scene:room"}]

    def opened(camera: str, source: str) -> RecordedAudioSource | LiveAudioSource | None:
        content = {"cameras": cameras, "sound": {"source": source}}
        return open_site_audio(build_config(content, where="hall", folder=tmp_path), camera)

    assert opened("c0", "c0") is not None
    assert opened("c1", "c0") is None, "one process sends it"
    assert opened("c0", "own.mp4") is not None
    with pytest.raises(UserError, match="sound: camera c1 has no audio: scene:room"):
        opened("c1", "c1")
    with pytest.raises(UserError, match=r"sound: .*none\.mp4: is neither a camera of this site nor a file"):
        opened("c0", "none.mp4")
    silent = tmp_path / "text.srt"
    silent.write_text("1\n00:00:00,000 --> 00:00:01,000\nno sound\n", encoding="utf-8")
    with pytest.raises(UserError, match=r"sound: .*there is no audio in this file"):
        opened("c0", "text.srt")


@given(st.sampled_from([24_000, 32_000, 44_100, 48_000]), st.sampled_from([1, 2]), st.integers(1, 60))
def test_silence_decodes_to_zero_samples(rate: int, channels: int, count: int) -> None:
    form = AudioFormat(rate, channels)
    data = count * (form.adts(len(form.silence)) + form.silence)
    with av.open(io.BytesIO(data), format="aac") as container:
        frames = list(container.decode(audio=0))
    assert [(frame.samples, frame.sample_rate, len(frame.layout.channels)) for frame in frames] == count * [
        (1024, rate, channels)
    ]
    assert not any(frame.to_ndarray().any() for frame in frames)


@given(
    st.integers(0, 2**40),
    st.sampled_from([7.5, 24, 25, 29.97, 30, 50, 59.94]),
    st.sampled_from([24_000, 48_000]),
)
def test_the_frame_of_a_pulse_sounds_when_it_is_due(pulse: int, fps: float, rate: int) -> None:
    number = AudioFormat(rate, 2).frame_at(pulse, fps)
    error = 1 + 2e-15 * pulse * rate / fps  # samples: rounded, and as precise as a float
    assert number * 1024 - error <= pulse * rate / fps <= (number + 1) * 1024 + error
