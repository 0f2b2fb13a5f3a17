"""A live camera over RTSP, HTTP, V4L2 or another input of FFmpeg: its newest image at each pulse."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import av
from av.audio.stream import AudioStream
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from server.camera.audio import LiveAudioSource
from server.camera.sources.base import Image
from server.camera.sources.opening import OpenedVideo, open_video
from server.camera.sources.orientation import INTERLACED, Orientation, parse_orientation, pixel_aspect
from server.camera.sources.stream_clock import CaptureTime
from server.camera.sources.stream_reader import OPEN_S, READ_S, StreamChangedError, StreamReader
from server.system.errors import UnavailableError

log = logging.getLogger(__name__)

_FIRST_FRAME_S = 2.0
"""Seconds to wait for the first frame, which carries the orientation."""
_STALE_S = 1.5
"""Age in seconds from which a frame is not shown again: the camera counts as away. Less than the two seconds
within which the view must change."""
_HELD_BACK = 2
"""Frames that FFmpeg holds back until the next one begins: one in the demuxer, one in the parser."""


class LiveStream(StreamReader):
    """Reads the camera in a thread, so that a pulse never waits for it; reconnects by itself."""

    recorded = False

    def __init__(self, url: str, options: Mapping[str, str], listener: LiveAudioSource | None = None) -> None:
        super().__init__(url, options)
        self._listener = listener
        opened = open_video(url, options, (OPEN_S, READ_S))
        self._stored = opened.size
        self._orientation = Orientation(pixel_aspect=pixel_aspect(opened.stream))
        self.size = self._orientation.size(self._stored)
        self._sized = threading.Event()
        """Set by the first frame; the size is fixed from then on."""
        self._misfit = ""
        """Why the stream of the newest connection does not fit what runs; empty: it does."""
        self._lock = threading.Lock()
        self._newest: VideoFrame | None = None
        self._newest_at = 0.0
        self._newest_captured: CaptureTime | None = None
        self.captured: CaptureTime | None = None
        """When the image that was taken last was captured."""
        self._silence = _Silence()
        self._start(opened)
        self._sized.wait(_FIRST_FRAME_S)
        self._sized.set()

    def take(self, pulse: int) -> Image | None:
        """Return the newest image; None while the camera is away.

        Raises:
            UnavailableError: the size of its images has changed; the caller has to open it again, because
                homography, boxes and appearance models belong to the old size.
        """
        del pulse
        self._check_fit()
        with self._lock:
            picture = self._newest if time.monotonic() - self._newest_at < _STALE_S else None
            self.captured = self._newest_captured
        return None if picture is None else self._oriented(picture).image(picture)

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:  # noqa: ARG002 — FrameSource
        """Return nothing: a live camera has no future frames."""
        return iter(())

    def _accept(self, opened: OpenedVideo) -> bool:
        """Prepare for a new connection; refuse one of another size."""
        aspect = pixel_aspect(opened.stream)
        size = replace(self._orientation, pixel_aspect=aspect).size(opened.size)
        self._misfit = "" if size == self.size else self._size_message(size)
        self._silence = _Silence()
        return not self._misfit

    def _check_fit(self) -> None:
        if misfit := self._misfit:
            raise UnavailableError(f"{self._name}: {misfit}")

    def _size_message(self, size: tuple[int, int]) -> str:
        return "its images are {}x{} now, they were {}x{}".format(*size, *self.size)

    def _audio_streams(self, opened: OpenedVideo) -> tuple[AudioStream, ...]:
        """Return the audio stream to read beside the video, if any."""
        if self._listener is None:
            return ()
        streams = opened.container.streams.audio[:1]
        self._listener.opened(streams[0] if streams else None)
        return streams

    def _use_audio(self, packet: av.Packet[AudioStream]) -> None:
        if self._listener is not None:
            self._listener.packet(packet)

    def _decode(self, packet: av.Packet[VideoStream]) -> bool:
        is_stale = self._silence.was_before(packet, time.monotonic())
        try:
            pictures = [picture for picture in packet.decode() if isinstance(picture, VideoFrame)]
        except av.error.FFmpegError:  # damaged; read errors are raised by the demuxer
            return False
        if pictures and not self._sized.is_set():
            self._set_orientation(pictures[0])
        for size in map(self._size_of, pictures):
            if size != self.size:
                raise StreamChangedError(self._size_message(size))
        if pictures and not is_stale:
            newest, now = pictures[-1], time.monotonic()
            with self._lock:
                self._newest, self._newest_at = newest, now
                self._newest_captured = self._clock.at(newest.time, now)
            if self._listener is not None and newest.pts is not None and newest.time_base is not None:
                self._listener.picture(newest.pts * newest.time_base)
        return bool(pictures)

    def _set_orientation(self, first: VideoFrame) -> None:
        """Set orientation and size from the first picture."""
        if (first.width, first.height) == self._stored:
            self._orientation = self._oriented(first)
            self.size = self._size_of(first)
        if first.interlaced_frame:
            log.warning("%s: %s", self._name, INTERLACED)
        self._sized.set()

    def _oriented(self, picture: VideoFrame) -> Orientation:
        return parse_orientation(picture, self._orientation.pixel_aspect)

    def _size_of(self, picture: VideoFrame) -> tuple[int, int]:
        return self._oriented(picture).size((picture.width, picture.height))


class _Silence:
    """Detects frames from before a silence of the camera that arrive after it.

    In some formats, such as MPEG-TS, a frame ends where the next one begins: the last ones before a silence
    arrive after it, and look new.
    """

    def __init__(self) -> None:
        self._at: float | None = None
        self._time = 0.0
        self._until, self._left = 0.0, 0

    def was_before(self, packet: av.Packet[VideoStream], now: float) -> bool:
        """Return whether a packet, by its time stamp, was sent before a silence that has just ended."""
        if packet.pts is None or packet.time_base is None:
            return False
        at, last = self._at, self._time
        self._at, self._time = now, float(packet.pts * packet.time_base)
        if at is not None and now - at > _STALE_S:
            # If time stamps jumped as well, a few new frames count as old, which is harmless.
            self._until, self._left = last + (now - at) / 2, _HELD_BACK
        if not self._left or self._time >= self._until:
            self._left = 0
            return False
        self._left -= 1
        return True
