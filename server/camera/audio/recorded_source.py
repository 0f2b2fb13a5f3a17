"""The sound of a recording, replayed on the pulses."""

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
from server.camera.audio.selection import select_framer
from server.camera.sources.frame_timing import frame_count, frame_rate
from server.config.sections import SoundSettings
from server.config.source_address import path_is_missing
from server.system.address_redaction import ffmpeg_reason, redact_address
from server.system.errors import UserError

log = logging.getLogger(__name__)

_WARM_S = 1
"""What is decoded of a recording before the moment at which it is first asked for."""
_AHEAD_S = Fraction(1, 5)
_FAR_S = 5


class RecordedAudioSource:
    """Audio of a recording: at pulse ``offset + n``, what sounds ``n / fps`` seconds after its first picture.

    What is of the site's format is passed on; all else is encoded.

    Raises:
        UserError: it cannot be opened, or there is no sound in it.
    """

    def __init__(
        self, path: str, settings: SoundSettings, fps: float, offset: int, at_end: Literal["stop", "loop"]
    ) -> None:
        form = settings.format
        if form is None:
            raise ValueError("a site without sound")
        self._path = path
        self._fps = Fraction(fps).limit_denominator(100_000)
        self._begin = offset / self._fps
        container, stream = _open(path)
        try:
            self._start = _first_picture(container)
            self._way: AudioFramer = select_framer(stream, form, settings.kbps)
            self._lasts = self._length(container, stream) if at_end == "loop" else None
        finally:
            container.close()
        self._packets: Iterator[tuple[Fraction, Packet]] | None = None
        self._waiting: tuple[Fraction, Packet] | None = None
        self._told = False
        """That it cannot be read to its end."""

    def at(self, pulse: int) -> list[EncodedAudioFrame]:
        """Return what is to be sent at a pulse: it is recorded, so it can be sent a moment early.

        The pictures of other cameras, shown at once, then find it there.
        """
        return self.until(pulse + max(1, round(_AHEAD_S * self._fps)))

    def until(self, pulse: int) -> list[EncodedAudioFrame]:
        """Return the frames that follow, up to what sounds when ``pulse`` is due; pulses must grow.

        The first call begins a second before that.
        """
        end = pulse / self._fps
        if self._packets is None:
            self._packets = self._from(max(Fraction(0), end - _WARM_S))
        frames: list[EncodedAudioFrame] = []
        while (found := self._waiting or next(self._packets, None)) is not None:
            self._waiting = found if found[0] >= end else None
            if self._waiting is not None:
                break
            frames += self._way.take(found[1], found[0])
        return frames

    def _from(self, moment: Fraction) -> Iterator[tuple[Fraction, Packet]]:
        """Yield the packets from a moment on with when they sound, seconds after pulse 0."""
        begin, lasts = self._begin, self._lasts
        if lasts is not None:
            begin += max(0, (moment - begin) // lasts) * lasts
        while True:
            heard = False
            for time, packet in self._once():
                if lasts is not None and time >= lasts:
                    break
                heard = True
                if begin + time >= moment:
                    yield begin + time, packet
            if lasts is None or not heard:  # what has none beside its pictures would be read for ever
                return
            begin += lasts

    def _once(self) -> Iterator[tuple[Fraction, Packet]]:
        """Yield the packets of one pass with when they sound after the first picture."""
        container, stream = _open(self._path)
        try:
            for time, packet in _in_order(container.demux(stream)):
                yield time - self._start, packet
        except av.error.FFmpegError as error:
            if not self._told:  # it may be read over and over
                log.warning(
                    "%s: its sound cannot be read any further: %s", redact_address(self._path), error.strerror
                )
            self._told = True
        finally:
            container.close()

    def _length(self, container: InputContainer, sound: AudioStream) -> Fraction:
        """Return the seconds after which it begins again: its pictures', or without any its sound's."""
        if (video := _pictures(container)) is not None:
            return _lasts(container, video, self._fps)
        ends = [
            (it.pts + (it.duration or 0)) * it.time_base
            for it in container.demux(sound)
            if it.pts is not None and it.time_base is not None
        ]
        return Fraction(max(ends, default=Fraction(1)))


def _first_picture(container: InputContainer) -> Fraction:
    """Return when the first picture is shown, in seconds of the file."""
    video = _pictures(container)
    if video is None or video.start_time is None:
        return Fraction(0)
    return Fraction(video.start_time * (video.time_base or 0))


def _lasts(container: InputContainer, video: VideoStream, fps: Fraction) -> Fraction:
    """Return the seconds that the pictures last, which are whole pulses: what plays them rounds likewise."""
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
    """Yield packets with their times in seconds, without single ones far ahead of what follows: damage."""
    reached: Fraction | None = None
    ahead: tuple[Fraction, Packet] | None = None
    for packet in packets:
        if packet.pts is None or packet.time_base is None or not packet.size:
            continue
        time = packet.pts * packet.time_base
        if ahead is not None and time >= ahead[0]:  # it was a gap
            yield ahead
            reached = ahead[0]
        ahead = None
        if reached is not None and time > reached + _FAR_S:
            ahead = time, packet
        else:
            yield time, packet
            reached = time


def _pictures(container: InputContainer) -> VideoStream | None:
    """Return the stream of its pictures, if it has one: that of a record's cover is none."""
    streams = container.streams.video
    return next((it for it in streams if not it.disposition & Disposition.attached_pic), None)


def _open(path: str) -> tuple[InputContainer, AudioStream]:
    name = redact_address(path)
    if path_is_missing(path):
        raise UserError(f"{name}: is neither a camera of this site nor a file")
    try:
        container = av.open(path)
    except (av.error.FFmpegError, OSError, ValueError) as error:
        raise UserError(f"{name}: cannot open this file: {ffmpeg_reason(error)}") from None
    if not container.streams.audio:
        container.close()
        raise UserError(f"{name}: there is no sound in this file")
    return container, container.streams.audio[0]
