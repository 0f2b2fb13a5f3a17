"""Small recordings that flash and beep at known times, and detection of these in streams."""

from __future__ import annotations

import io
from fractions import Fraction
from functools import cache
from itertools import pairwise
from pathlib import Path

import av
import msgspec
import numpy as np
from av.audio.stream import AudioStream
from av.video.stream import VideoStream
from numpy.typing import NDArray

from fakes.service.scripted_cameras import GOP, FedService
from server.camera.audio import EncodedAudioFrame, RecordedAudioSource, consecutive_runs
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.messaging.inbox import Message
from server.messaging.messages import AudioHeader, ZenohKeys

WIDTH, HEIGHT, FPS = 64, 48, 25
FLASH_INTERVAL = 20
"""Pictures from one flash to the next: 0.8 s."""
_FLASH_FRAMES = 2
"""Duration of a flash, frames."""

GOPS = 24
FRAMES = GOPS * GOP
MAX_AV_OFFSET_S = 0.04
"""Maximum offset between sound and picture, seconds."""
BEEP_TIMES = [number / FPS for number in range(FLASH_INTERVAL, FRAMES, FLASH_INTERVAL)]


def write_flashes(
    path: Path,
    frames: int,
    *,
    codec: str = "aac",
    rate: int = 48_000,
    channels: int = 2,
    pictures: bool = True,
    options: dict[str, str] | None = None,
) -> Path:
    """Write a recording that flashes and beeps at frames EVERY, 2 · EVERY and so on."""
    with av.open(str(path), "w") as container:
        video = container.add_stream("libx264", rate=FPS) if pictures else None
        audio = container.add_stream(codec, rate=rate, options=options or {})
        assert isinstance(audio, AudioStream)
        audio.layout = "mono" if channels == 1 else "stereo"
        if isinstance(video, VideoStream):
            video.width, video.height, video.pix_fmt = WIDTH, HEIGHT, "yuv420p"
            for number in range(frames):
                gray = 255 * _is_flash(number)
                picture = np.full((HEIGHT, WIDTH, 3), gray, dtype=np.uint8)
                frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
                frame.pts, frame.time_base = number, Fraction(1, FPS)
                container.mux(video.encode(frame))
            container.mux(video.encode(None))
        for number in range(frames):
            container.mux(audio.encode(_audio_frame(number, rate, audio.layout.name)))
        container.mux(audio.encode(None))
    return path


def _is_flash(number: int) -> bool:
    return number >= FLASH_INTERVAL and number % FLASH_INTERVAL < _FLASH_FRAMES


def _audio_frame(number: int, rate: int, layout: str) -> av.AudioFrame:
    samples = rate // FPS
    time = (number * samples + np.arange(samples)) / rate
    wave = 0.5 * np.sin(2 * np.pi * 1000 * time) * _is_flash(number)
    channels = 1 if layout == "mono" else 2
    interleaved = np.repeat((wave * 32767).astype(np.int16), channels)[None]
    frame = av.AudioFrame.from_ndarray(interleaved, format="s16", layout=layout)
    frame.sample_rate, frame.pts, frame.time_base = rate, number * samples, Fraction(1, rate)
    return frame


@cache
def access_units(recording: Path) -> tuple[AccessUnit, ...]:
    """Return the recording's pictures as access units of a camera."""
    encoder = Encoder(SiteSettings(width=64, height=48, fps=FPS), EncodeSettings(gop_s=GOP / FPS))
    with av.open(str(recording)) as container:
        pictures = [frame.to_ndarray(format="bgr24") for frame in container.decode(video=0)]
    return tuple(encoder.encode(pulse, picture) for pulse, picture in enumerate(pictures))


def send_audio(service: FedService, recording: Path, silent: range = range(0)) -> list[bytes]:
    """Send the recording's audio frames except the `silent` ones; return all frames."""
    sound = RecordedAudioSource(str(recording), service.config.sound, FPS, 0, "stop")
    frames = [*sound.until(0), *sound.until(FRAMES)]
    for message in audio_messages([frame for frame in frames if frame.number not in silent]):
        service.ingest.receive_audio(message)
    return [frame.data for frame in frames]


def audio_messages(frames: list[EncodedAudioFrame]) -> list[Message]:
    """Return audio frames as received from the bus."""
    return [
        Message(
            ZenohKeys("hall").sound,
            b"".join(frame.data for frame in run),
            msgspec.msgpack.encode(
                AudioHeader(first=run[0].number, sizes=[len(frame.data) for frame in run])
            ),
        )
        for run in consecutive_runs(frames)
    ]


def packets(stream: bytes) -> list[bytes]:
    """Return the encoded audio frames of an MP4."""
    with av.open(io.BytesIO(stream)) as container:
        return [bytes(packet) for packet in container.demux(audio=0) if packet.size]


def decode_audio(stream: bytes, kind: str | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Decode the audio of a stream: times of all samples (seconds), and the samples of one channel."""
    with av.open(io.BytesIO(stream), format=kind) as container:
        frames = list(container.decode(audio=0))
    times = [float(frame.time or 0) + np.arange(frame.samples) / frame.sample_rate for frame in frames]
    return np.concatenate(times), np.concatenate([frame.to_ndarray()[0] for frame in frames])


def beeps(stream: bytes, kind: str | None = None) -> list[float]:
    """Return the start times of beeps in a stream, seconds."""
    times, samples = decode_audio(stream, kind)
    return _group_starts(times[np.abs(samples) > 0.1])


def flashes(stream: bytes, kind: str | None = None) -> list[float]:
    """Return the start times of flashes in a stream, seconds."""
    with av.open(io.BytesIO(stream), format=kind) as container:
        bright = [
            frame.time for frame in container.decode(video=0) if frame.to_ndarray(format="gray").mean() > 128
        ]
    return _group_starts(np.array(bright, dtype=np.float64))


def _group_starts(times: NDArray[np.float64]) -> list[float]:
    """Return the first time of each group of close times."""
    earlier = [-1.0, *times]
    return [float(time) for before, time in pairwise(earlier) if time - before > 0.2]
