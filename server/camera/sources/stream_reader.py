"""Reads a stream in a thread, and connects again when it ends."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import cast

import av
from av.audio.stream import AudioStream
from av.video.stream import VideoStream

from expbackoff import Backoff
from logthrottle import LogThrottle
from server.camera.sources.opening import OpenedVideo, VideoError, open_video, timeout_message
from server.camera.sources.stream_clock import StreamClock
from server.messaging.camera_status import RetryPause
from server.system.address_redaction import ffmpeg_reason, redact_to_host

log = logging.getLogger(__name__)

OPEN_S, READ_S = 10.0, 5.0
"""Timeouts of connecting and of reading, in seconds."""
_RETRY_FIRST_S, _RETRY_MAX_S = 0.5, 10.0
_STABLE_S = 3.0
"""How long frames must have arrived for the next absence to begin with the shortest delay again."""
_JOIN_S = 0.5


class StreamChangedError(Exception):
    """The stream is not what it was; the text says how. The next connection tells damage from a change."""


class StreamReader:
    """Reads a camera's stream; what becomes of its packets is up to the class derived from this."""

    _thread: threading.Thread

    def __init__(self, url: str, options: Mapping[str, str]) -> None:
        self._url, self._options = url, options
        self._name = redact_to_host(url)
        self.absence: RetryPause | None = None
        """Why no frames arrive, and when it connects again; None: they arrive, or the connection is open."""
        self._clock = StreamClock()
        """Of the present connection."""
        self._closing = threading.Event()
        self._away_log = LogThrottle(quiet_s=0.0)

    def _start(self, opened: OpenedVideo | None) -> None:
        """Begin to read from a connection; None: connect first."""
        self._thread = threading.Thread(target=self._run, args=(opened,), name="source", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop reading."""
        self._closing.set()
        self._thread.join(_JOIN_S)  # a silent camera may block it for longer; it ends by itself

    def _accept(self, opened: OpenedVideo) -> bool:
        """Prepare for a new connection; return whether its stream can be used."""
        raise NotImplementedError

    def _decode(self, packet: av.Packet[VideoStream]) -> bool:
        """Use a packet of the video; return whether it was a picture.

        Raises:
            StreamChangedError: the connection is of no more use.
        """
        raise NotImplementedError

    def _audio_streams(self, opened: OpenedVideo) -> tuple[AudioStream, ...]:  # noqa: ARG002 — for derived classes
        """Return the audio stream to read beside the video, if any."""
        return ()

    def _use_audio(self, packet: av.Packet[AudioStream]) -> None:
        """Use a packet of the audio."""

    def _run(self, opened: OpenedVideo | None) -> None:
        backoff = Backoff(_RETRY_FIRST_S, _RETRY_MAX_S)
        if opened is None:
            opened = self._connect()
        while not self._closing.is_set():
            if opened is not None and self._read_safely(opened):
                backoff.reset()
            pause_s = backoff.next()
            if self.absence is not None:
                self.absence = replace(self.absence, until=time.monotonic() + pause_s)
            if self._closing.wait(pause_s):
                return
            opened = self._connect()

    def _connect(self) -> OpenedVideo | None:
        try:
            return open_video(self._url, self._options, (OPEN_S, READ_S))
        except VideoError as error:
            self._record_away(error.reason)
            return None

    def _read(self, opened: OpenedVideo) -> bool:
        """Read until the connection ends; return whether frames have arrived for some time."""
        if not self._accept(opened):
            opened.container.close()
            return False
        first_at: float | None = None
        last_at, reason = 0.0, "the connection has ended"
        self._clock = StreamClock()
        try:
            for packet in opened.container.demux(opened.stream, *self._audio_streams(opened)):
                if self._closing.is_set():
                    break
                if packet.stream is opened.stream:
                    video = cast("av.Packet[VideoStream]", packet)
                    self._clock.observe(video, now := time.monotonic())
                    if self._decode(video):
                        first_at, last_at = now if first_at is None else first_at, now
                        self._record_frame()
                else:
                    self._use_audio(cast("av.Packet[AudioStream]", packet))
        except StreamChangedError as error:
            reason = str(error)
        except (av.error.FFmpegError, OSError) as error:
            reason = f"reading stopped: {timeout_message(error, READ_S) or ffmpeg_reason(error)}"
        finally:
            opened.container.close()
        if not self._closing.is_set():
            self._record_away(reason)
        return first_at is not None and last_at - first_at >= _STABLE_S

    def _record_away(self, reason: str, *, unexpected: bool = False) -> None:
        """Record that the camera is away, and log it; throttled, as it may come and go."""
        self.absence = RetryPause(reason, "lost", time.monotonic(), self._name)
        if (more := self._away_log.record(reason)) is not None:
            log.warning("%s: %s%s; retrying", self._name, reason, more, exc_info=unexpected)

    def _record_frame(self) -> None:
        """Record that frames arrive."""
        self.absence = None
        if ended := self._away_log.end():
            log.info("%s: frames arrive again, after %.0f s", self._name, ended.seconds)

    def _read_safely(self, opened: OpenedVideo) -> bool:
        """Read, and log unexpected errors: the thread must survive them."""
        try:
            return self._read(opened)
        except Exception as error:  # noqa: BLE001 — logged with its traceback
            self._record_away(f"unexpected {type(error).__name__}", unexpected=True)
            opened.container.close()
            return False
