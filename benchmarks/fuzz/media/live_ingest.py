"""Target for live streams of cameras in three container formats, with and without audio."""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import av
import numpy as np
from av.video.stream import VideoStream

from benchmarks.fuzz.engine.fed_site import FPS, HEIGHT, STRIDE, WIDTH
from benchmarks.fuzz.engine.target import ScriptTarget, folder, refused
from benchmarks.fuzz.media.damaged_media import damage_media
from server.camera.audio.live_source import LiveAudioSource
from server.camera.passthrough.compatibility import IncompatibleStreamError, RequiredFormat
from server.camera.passthrough.stream_source import PassthroughStream
from server.camera.sources.live_stream import LiveStream
from server.camera.sources.opening import OpenedVideo
from server.config.sections import SoundSettings
from server.media.h264.codec import H264
from server.system.errors import UserError

_FRAMES = 2 * STRIDE + 3
"""Options of FFmpeg for probing."""
_FORMS = {"mpegts": "libx264", "h264": "libx264", "mpjpeg": "mjpeg"}


class _SingleRead(LiveStream):
    """A live stream that is read once to its end, and keeps the exception of its thread."""

    failure: BaseException | None = None
    units = 0
    """Frames read from the stream."""

    def _run(self, opened: OpenedVideo | None) -> None:
        try:
            if opened is not None:
                self._read(opened)
        except BaseException as error:  # noqa: BLE001 — re-raised by the target
            self.failure = error

    def _decode(self, packet: av.Packet[VideoStream]) -> bool:
        self.units += bool(packet.size)
        return super()._decode(packet)


class _SinglePassthroughRead(PassthroughStream, _SingleRead):
    """The passthrough stream, likewise."""

    def _decode(self, packet: av.Packet[VideoStream]) -> bool:
        self.units += bool(packet.size)
        return super()._decode(packet)


class LiveIngest(ScriptTarget):
    """Target for live streams of a camera, read from a file, without network protocols."""

    name = "media-live"
    _required = RequiredFormat((WIDTH, HEIGHT), FPS, STRIDE, H264, None)

    def __init__(self) -> None:
        self._folder, self._memory = TemporaryDirectory(), folder()
        self._path = (
            Path(self._folder.name) / "sent" / "camera"
        )  # a path below /dev would be a capture device
        self._path.parent.symlink_to(self._memory.name)
        self._sent = [_sent(form, codec) for form, codec in _FORMS.items()]

    def make(self, rng: Random) -> bytes:
        """Return the mode, and the stream."""
        return rng.choice((b"D", b"P")) + damage_media(rng, rng.choice(self._sent))

    def feed(self, data: bytes) -> bool:
        """Decode the stream, or pass it through."""
        self._path.write_bytes(data[1:])
        sound = LiveAudioSource(SoundSettings(source="c0"), FPS)
        try:
            if data[:1] == b"P":
                self._watch(
                    _SinglePassthroughRead(str(self._path), {}, sound, self._required), range(_FRAMES)
                )
            else:
                self._watch(_SingleRead(str(self._path), {}, sound), range(1))
        except (UserError, IncompatibleStreamError) as error:
            self.messages += 1
            return refused(error)
        sound.take(0)
        return True

    def _watch(self, stream: _SingleRead, pulses: Iterable[int]) -> None:
        stream._thread.join()
        self.messages += stream.units
        for pulse in pulses:
            stream.take(pulse)
        stream.close()
        if stream.failure is not None:
            raise stream.failure

    def close(self) -> None:
        """Remove the folders."""
        self._folder.cleanup()
        self._memory.cleanup()


def _sent(form: str, codec: str) -> bytes:
    """Return some GOPs as a camera sends them, with audio where the format has it."""
    sent = io.BytesIO()
    with av.open(sent, "w", format=form) as out:
        stream = out.add_stream(codec, rate=FPS)
        assert isinstance(stream, av.VideoStream)
        if codec == "libx264":
            stream.options = {"preset": "ultrafast", "g": str(STRIDE), "bf": "0", "sc_threshold": "0"}
        stream.width, stream.height = WIDTH, HEIGHT
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        audio_stream = out.add_stream("aac", 48_000) if form == "mpegts" else None
        rng = np.random.default_rng(1)
        for frame in range(_FRAMES):
            image = np.repeat(rng.integers(0, 255, (HEIGHT, WIDTH // 8, 3), dtype=np.uint8), 8, axis=1)
            picture = av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format=stream.pix_fmt)
            picture.pts = frame
            out.mux(stream.encode(picture))
            if audio_stream is not None:
                tone = av.AudioFrame.from_ndarray(np.zeros((2, 1920), dtype=np.float32), "fltp", "stereo")
                tone.sample_rate, tone.pts = 48_000, frame * 1920
                out.mux(audio_stream.encode(tone))
        out.mux(stream.encode())
        if audio_stream is not None:
            out.mux(audio_stream.encode())
    return sent.getvalue()
