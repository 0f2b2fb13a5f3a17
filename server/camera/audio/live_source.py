"""Live audio of a network camera, in step with its video."""

from __future__ import annotations

import logging
import threading
from collections import deque
from fractions import Fraction

from av.audio.stream import AudioStream

from logthrottle import LogThrottle
from server.camera.audio.frames import AudioFramer, EncodedAudioFrame, Packet
from server.camera.audio.passthrough import select_framer
from server.config.sections import SoundSettings

log = logging.getLogger(__name__)

_MEAN_S = 4.0
"""Seconds over which the frames' delay is averaged: it varies, since each waits for its pulse."""
_RESET_S = 0.5
"""A change of delay by more than this, in seconds, restarts the average."""
_BUFFER_S = 2.0
"""Seconds of audio to buffer."""
_MAX_OFFSET_S = 2.0
"""Audio further than this from the current frame, in seconds, is dropped: a clock has stepped."""


class LiveAudioSource:
    """Audio of a network camera, aligned with its video by the camera's own clock.

    The source's thread passes frame times and packets; ``take`` is called in another thread. Frames, and
    audio with them, wait up to ``waiting_s`` seconds until they are shown.
    """

    def __init__(self, settings: SoundSettings, fps: float, waiting_s: float = 0.0) -> None:
        audio_format = settings.format
        if audio_format is None:
            raise ValueError("the site has no audio")
        self._format, self._kbps, self._fps = audio_format, settings.kbps, fps
        self._max_offset_s = _MAX_OFFSET_S + waiting_s
        self._lock = threading.Lock()
        self._shown_at = 0.0
        """The newest pulse's time, seconds after pulse 0."""
        self._newest: Fraction | None = None
        """When the newest frame was captured, by the camera's clock."""
        self._shifts: deque[float] = deque(maxlen=max(1, round(_MEAN_S * fps)))
        """Of the last frames: pulse time minus camera time."""
        self._shift: Fraction | None = None
        self._frames: deque[EncodedAudioFrame] = deque(
            maxlen=round(_BUFFER_S * audio_format.rate / audio_format.samples)
        )
        self._framer: AudioFramer | None = None
        self._last = -1
        self._no_audio = LogThrottle(quiet_s=0.0)

    def opened(self, stream: AudioStream | None) -> None:
        """Start with a new connection's audio stream; None: it has none."""
        self._framer = None
        if stream is None:
            if (more := self._no_audio.record()) is not None:
                log.warning("the camera sends no audio%s; the site is silent", more)
        else:
            if self._no_audio.end():
                log.info("the camera sends audio again")
            self._framer = select_framer(stream, self._format, self._kbps)

    def picture(self, time: Fraction) -> None:
        """Set when the newest frame was captured, by the camera's clock."""
        with self._lock:
            self._newest = time

    def packet(self, packet: Packet) -> None:
        """Add an audio packet."""
        with self._lock:
            shift, shown_at = self._shift, self._shown_at
        if shift is None or self._framer is None or packet.pts is None or packet.time_base is None:
            return
        at = packet.pts * packet.time_base + shift
        if abs(at - shown_at) > self._max_offset_s:
            return  # accepting it would make all earlier audio late
        for frame in self._framer.take(packet, at):
            if frame.number <= self._last:
                continue  # sent already: after a reconnect, or since the mean delay has changed
            self._last = frame.number
            with self._lock:
                self._frames.append(frame)

    def take(self, pulse: int) -> list[EncodedAudioFrame]:
        """Return the audio frames since the previous pulse; the newest video frame is shown at this one."""
        with self._lock:
            self._shown_at = pulse / self._fps
            if self._newest is not None:
                self._add_shift(pulse / self._fps - float(self._newest))
                self._newest = None
            frames = list(self._frames)
            self._frames.clear()
        return frames

    def _add_shift(self, shift: float) -> None:
        if self._shift is not None and abs(shift - self._shift) > _RESET_S:
            self._shifts.clear()
        self._shifts.append(shift)
        self._shift = Fraction(sum(self._shifts) / len(self._shifts))
