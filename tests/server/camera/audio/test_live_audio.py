"""Audio of a network camera is in sync with its video, by the camera's own clock."""

from __future__ import annotations

import contextlib
import http.server
import threading
import time
from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import pytest

from fakes.media.audio import FLASH_INTERVAL, FPS, beeps, write_flashes
from fakes.timeouts import PATIENCE
from server.camera.audio import EncodedAudioFrame, LiveAudioSource
from server.camera.sources.live_stream import LiveStream
from server.config.sections import SoundSettings
from server.media.audio.aac import SAMPLES as FRAME
from server.media.audio.audio_format import AudioFormat, Coding
from server.media.containers.mp4_audio import audio_fragment, audio_init_segment

FRAMES = 3 * FLASH_INTERVAL
FORM = AudioFormat(48_000, 2)


def send(path: Path, to: Any) -> None:
    """Send a recording in real time, as a camera does."""
    begin = time.monotonic()
    with (
        av.open(str(path)) as recorded,
        av.open(to, "w", format="mpegts", buffer_size=1316, options={"flush_packets": "1"}) as sent,
    ):
        streams = {stream.index: sent.add_stream_from_template(stream) for stream in recorded.streams}
        for packet in recorded.demux():
            if packet.dts is None:
                continue
            time.sleep(max(0.0, begin + float(packet.dts * packet.time_base) + 0.1 - time.monotonic()))
            packet.stream = streams[packet.stream.index]
            sent.mux(packet)


@pytest.fixture
def camera(tmp_path: Path) -> Iterator[str]:
    """The address of a camera that flashes and beeps in real time."""
    path = write_flashes(tmp_path / "own.ts", FRAMES)

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.end_headers()
            with contextlib.suppress(OSError, av.error.FFmpegError):
                send(path, self.wfile)

        def log_message(self, *_: object) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}/"
    server.shutdown()
    thread.join()
    server.server_close()


def test_the_audio_of_a_camera_is_received_with_its_video(camera: str) -> None:
    sound = LiveAudioSource(SoundSettings(source="c0"), FPS)
    source = LiveStream(camera, {"probesize": "20000", "analyzeduration": "200000"}, sound)
    frames: list[EncodedAudioFrame] = []
    begin = time.monotonic()
    while len(frames) < (FRAMES - 20) / FPS * FORM.rate / FRAME:
        time.sleep(1 / FPS)
        assert time.monotonic() < begin + PATIENCE, "no audio arrives"
        frames += sound.take(100 + int((time.monotonic() - begin) * FPS))
    assert source.take(0) is not None
    source.close()
    assert len(beep_times(frames)) >= 1
    assert [frame.number for frame in frames] == sorted({frame.number for frame in frames})


def beep_times(frames: list[EncodedAudioFrame], form: AudioFormat = FORM) -> list[float]:
    """Return when beeps begin, seconds after pulse 0."""
    found = {frame.number: frame.data for frame in frames}
    data = [found.get(number, form.silence) for number in range(max(found) + 1)]
    return beeps(audio_init_segment(form) + audio_fragment(form, data, 0))


def pass_to_source(path: Path, sound: LiveAudioSource, first: int) -> list[EncodedAudioFrame]:
    """Pass a recording to the source, with pulse numbers ``first`` ahead of its frames; return its frames."""
    frames: list[EncodedAudioFrame] = []
    with av.open(str(path)) as container:
        sound.opened(container.streams.audio[0])
        for packet in container.demux():
            if packet.pts is None:
                continue
            if packet.stream.type == "audio":
                sound.packet(packet)
                continue
            picture = Fraction(packet.pts * packet.time_base)
            sound.picture(picture)
            number = round(picture * FPS)
            frames += sound.take(first + number + number % 3 // 2)  # one in three is late by a pulse
    return frames


@pytest.mark.parametrize(
    ("codec", "sends"), [("aac", "aac"), ("aac", "libopus"), ("opus", "libopus"), ("opus", "aac")]
)
def test_audio_is_in_sync_with_video_also_after_a_restart_of_the_camera(
    tmp_path: Path, codec: Coding, sends: str
) -> None:
    path = write_flashes(tmp_path / "own.mp4", FRAMES, codec=sends)
    settings = SoundSettings(source="c0", codec=codec)
    sound = LiveAudioSource(settings, FPS)
    one, two = pass_to_source(path, sound, 50), pass_to_source(path, sound, 50 + 2 * FRAMES)
    numbers = [frame.number for frame in one + two]
    assert numbers == sorted(set(numbers)), "each once, in order"
    assert len(two) > 0.9 * len(one)
    starts = (50, 50 + 2 * FRAMES)
    expected = [
        (start + number) / FPS for start in starts for number in range(FLASH_INTERVAL, FRAMES, FLASH_INTERVAL)
    ]
    assert settings.format is not None
    assert beep_times(one + two, settings.format) == pytest.approx(expected, abs=0.04)


@pytest.mark.parametrize(("rate", "channels"), [(48_000, 1), (44_100, 2), (32_000, 1)])
def test_audio_continues_when_its_format_changes(tmp_path: Path, rate: int, channels: int) -> None:
    before = write_flashes(tmp_path / "before.aac", FRAMES, rate=rate, channels=channels, pictures=False)
    after = write_flashes(tmp_path / "after.aac", FRAMES, pictures=False)
    both = tmp_path / "both.aac"
    both.write_bytes(before.read_bytes() + after.read_bytes())
    sound, frames = LiveAudioSource(SoundSettings(source="c0"), FPS), []
    with av.open(str(both)) as container:
        sound.opened(container.streams.audio[0])
        for packet in container.demux(audio=0):
            if packet.pts is not None:
                sound.picture(Fraction(packet.pts * packet.time_base))
                frames += sound.take(round(packet.pts * packet.time_base * FPS))
                sound.packet(packet)
    assert len(beep_times(frames)) == 2 * len(range(FLASH_INTERVAL, FRAMES, FLASH_INTERVAL))


def shift_packet(packet: av.Packet[Any], seconds: int) -> av.Packet[Any]:
    assert packet.pts is not None
    packet.pts += round(seconds / packet.time_base)
    packet.dts = packet.pts
    return packet


@pytest.mark.parametrize("sends", ["aac", "libopus"], ids=["passed on", "encoded"])
@pytest.mark.parametrize("lag", [0.0, 0.1, 0.3, -0.1])
def test_audio_continues_after_a_time_step_and_after_a_reconnect(
    tmp_path: Path, sends: str, lag: float
) -> None:
    """MPEG-TS times wrap once in 26.5 hours; here the audio's wrap ``lag`` after the pictures'."""
    path = write_flashes(tmp_path / "own.mp4", FRAMES, codec=sends)
    sound, wrap, step = LiveAudioSource(SoundSettings(source="c0"), FPS), 95_443, FRAMES / FPS / 2
    frames: list[EncodedAudioFrame] = []
    for run in (0, 1):
        with av.open(str(path)) as container:
            sound.opened(container.streams.audio[0])
            for packet in container.demux():
                if packet.pts is None:
                    continue
                time = float(packet.pts * packet.time_base)
                is_sound = packet.stream.type == "audio"
                old = not run and time < step + (lag if is_sound else 0.0)
                if is_sound:
                    sound.packet(shift_packet(packet, wrap if old else 0))
                else:
                    sound.picture(Fraction(shift_packet(packet, wrap if old else 0).pts * packet.time_base))
                    frames += sound.take(round(time * FPS) + run * 2 * FRAMES)
    numbers = [frame.number for frame in frames]
    assert numbers == sorted(set(numbers)), "each once, in order"
    halves = [0.0, step, FRAMES / FPS, 2 * FRAMES / FPS, 3 * FRAMES / FPS]
    first, second, _, restarted = (
        sum(begin <= number * FRAME / FORM.rate < end for number in numbers)
        for begin, end in pairwise(halves)
    )
    each = step * FORM.rate / FRAME
    assert first > 0.9 * each - 3
    assert second > 0.9 * each - (abs(lag) + 0.1) * FORM.rate / FRAME
    assert restarted > 0.9 * 2 * each - 3
    assert numbers[-1] < 3 * FRAMES / FPS * FORM.rate / FRAME


def test_a_camera_without_audio_is_valid(tmp_path: Path) -> None:
    path = write_flashes(tmp_path / "own.mp4", 10)
    sound = LiveAudioSource(SoundSettings(source="c0"), FPS)
    sound.opened(None)
    with av.open(str(path)) as container:
        for packet in container.demux(audio=0):
            sound.picture(Fraction(0))
            sound.packet(packet)
    assert sound.take(5) == []
