"""Audio of a recording, replayed on the pulses."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Literal

import av
from av.audio.stream import AudioStream
from av.container import InputContainer
from av.stream import Disposition
from av.video.stream import VideoStream

from server.camera.audio.frames import AudioFramer, EncodedAudioFrame, Packet
from server.camera.audio.passthrough import select_framer
from server.camera.sources.frame_timing import frame_count, frame_rate
from server.config.sections import SoundSettings
from server.config.source_address import path_is_missing
from server.system.address_redaction import ffmpeg_reason, redact_to_host
from server.system.errors import UserError, reason_of

log = logging.getLogger(__name__)

_WARM_UP_S = 1
"""Seconds to decode before the first requested time."""
_LEAD_S = Fraction(1, 5)
_MAX_JUMP_S = 5


class RecordedAudioSource:
    """Audio of a recording: pulse ``offset + n`` plays the audio ``n / fps`` seconds after its first frame.

    Audio of the site's format is passed through, other audio encoded.

    Raises:
        UserError: the file cannot be opened, or has no audio.
    """

    def __init__(
        self, path: str, settings: SoundSettings, fps: float, offset: int, at_end: Literal["stop", "loop"]
    ) -> None:
        audio_format = settings.format
        if audio_format is None:
            raise ValueError("the site has no audio")
        self._path = path
        self._fps = Fraction(fps).limit_denominator(100_000)
        self._begin = offset / self._fps
        container, stream = _open(path)
        try:
            self._start = _first_frame_time(container)
            self._framer: AudioFramer = select_framer(stream, audio_format, settings.kbps)
            self._duration = self._loop_duration(container, stream) if at_end == "loop" else None
        finally:
            container.close()
        self._packets: Iterator[tuple[Fraction, Packet]] | None = None
        self._waiting: tuple[Fraction, Packet] | None = None
        self._has_warned = False
        """Whether a read error was logged."""

    def take(self, pulse: int) -> list[EncodedAudioFrame]:
        """Return the frames to send at a pulse: a fifth of a second early, to arrive before its video."""
        return self.until(pulse + max(1, round(_LEAD_S * self._fps)))

    def until(self, pulse: int) -> list[EncodedAudioFrame]:
        """Return the next frames, up to the time of ``pulse``; pulses must ascend.

        The first call begins a second earlier.
        """
        end = pulse / self._fps
        if self._packets is None:
            self._packets = self._packets_from(max(Fraction(0), end - _WARM_UP_S))
        frames: list[EncodedAudioFrame] = []
        while (timed := self._waiting or next(self._packets, None)) is not None:
            self._waiting = timed if timed[0] >= end else None
            if self._waiting is not None:
                break
            frames += self._framer.take(timed[1], timed[0])
        return frames

    def _packets_from(self, start: Fraction) -> Iterator[tuple[Fraction, Packet]]:
        """Yield the packets from a time on, each with its time in seconds after pulse 0."""
        begin, duration = self._begin, self._duration
        if duration is not None:
            begin += max(0, (start - begin) // duration) * duration
        while True:
            has_packets = False
            for time, packet in self._one_pass():
                if duration is not None and time >= duration:
                    break
                has_packets = True
                if begin + time >= start:
                    yield begin + time, packet
            if duration is None or not has_packets:  # an empty pass would loop forever
                return
            begin += duration

    def _one_pass(self) -> Iterator[tuple[Fraction, Packet]]:
        """Yield the packets of one pass, each with its time in seconds after the first video frame."""
        container, stream = _open(self._path)
        try:
            for time, packet in _in_order(container.demux(stream)):
                yield time - self._start, packet
        except av.error.FFmpegError as error:
            if not self._has_warned:  # a loop would repeat it
                log.warning(
                    "%s: its audio cannot be read any further: %s",
                    redact_to_host(self._path),
                    reason_of(error),
                )
            self._has_warned = True
        finally:
            container.close()

    def _loop_duration(self, container: InputContainer, audio: AudioStream) -> Fraction:
        """Return the duration of a loop in seconds: that of the video, else of the audio."""
        if (video := _video_stream(container)) is not None:
            return _video_duration(container, video, self._fps)
        ends = [
            (packet.pts + (packet.duration or 0)) * packet.time_base
            for packet in container.demux(audio)
            if packet.pts is not None and packet.time_base is not None
        ]
        return Fraction(max(ends, default=Fraction(1)))


def _first_frame_time(container: InputContainer) -> Fraction:
    """Return the time stamp of the first video frame, in seconds."""
    video = _video_stream(container)
    if video is None or video.start_time is None:
        return Fraction(0)
    return Fraction(video.start_time * (video.time_base or 0))


def _video_duration(container: InputContainer, video: VideoStream, fps: Fraction) -> Fraction:
    """Return the duration of the video in seconds, rounded to whole pulses as in playback."""
    unit = video.time_base or Fraction(0)
    times, count = list[int](), 0
    for packet in container.demux(video):
        count += bool(packet.size)
        if packet.pts is not None:
            times.append(packet.pts)
    if not times:
        return count / fps
    return frame_count(float((max(times) - min(times)) * unit), frame_rate(video), float(fps)) / fps


def _in_order(packets: Iterable[Packet]) -> Iterator[tuple[Fraction, Packet]]:
    """Yield packets with their times in seconds; a single damaged one far ahead of the next is dropped."""
    reached: Fraction | None = None
    ahead: tuple[Fraction, Packet] | None = None
    for packet in packets:
        if packet.pts is None or packet.time_base is None or not packet.size:
            continue
        time = packet.pts * packet.time_base
        if ahead is not None and time >= ahead[0]:  # it was a gap, not damage
            yield ahead
            reached = ahead[0]
        ahead = None
        if reached is not None and time > reached + _MAX_JUMP_S:
            ahead = time, packet
        else:
            yield time, packet
            reached = time


def _video_stream(container: InputContainer) -> VideoStream | None:
    """Return the video stream, if any; a cover image does not count."""
    streams = container.streams.video
    return next((video for video in streams if not video.disposition & Disposition.attached_pic), None)


def _open(path: str) -> tuple[InputContainer, AudioStream]:
    name = redact_to_host(path)
    if path_is_missing(path):
        raise UserError(f"{name}: is neither a camera of this site nor a file")
    try:
        container = av.open(path)
    except (av.error.FFmpegError, OSError, ValueError) as error:
        raise UserError(f"{name}: cannot open this file: {ffmpeg_reason(error)}") from None
    if not container.streams.audio:
        container.close()
        raise UserError(f"{name}: there is no audio in this file")
    return container, container.streams.audio[0]
