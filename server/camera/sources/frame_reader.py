"""Reads a recording's frames with their times, even from a damaged file."""

from __future__ import annotations

import errno
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import av
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from server.camera.sources.opening import OpenedVideo
from server.camera.sources.timestamp_jump_repair import TimestampJumpRepair
from server.system.address_redaction import redact_to_host
from server.system.errors import reason_of

log = logging.getLogger(__name__)

_COUNTED_WHEN_REORDERED = frozenset({"avi"})
"""Containers whose time stamps count packets in decoding order: with reordering they are not presentation
times."""


@dataclass(frozen=True, slots=True, eq=False)
class TimedFrame:
    """A frame of a recording.

    Attributes:
        seconds: its presentation time, after the recording's first frame.
        picture: the decoded picture; None: it could not be decoded, and the previous one is repeated.
    """

    seconds: float
    picture: VideoFrame | None


def read_frames(opened: OpenedVideo, *, quiet: bool = False) -> Iterator[TimedFrame]:
    """Yield the frames in presentation order, including those that cannot be decoded.

    Reading ends at a read error. Warnings are logged unless ``quiet``, for a file that is read once more.
    """
    timeline: _Timeline | None = None
    for packet in _packets(opened, quiet=quiet):
        if timeline is None:
            timeline = _select_timeline(opened, packet, quiet=quiet)
        yield from timeline.decode(packet)
    if timeline is not None:
        yield from timeline.flush()


class _Timeline(Protocol):
    def decode(self, packet: av.Packet[VideoStream]) -> Iterator[TimedFrame]:
        """Decode a packet; yield the frames whose order is now known."""
        ...

    def flush(self) -> Iterator[TimedFrame]:
        """Yield the frames lost at the end."""
        ...


def _select_timeline(opened: OpenedVideo, first: av.Packet[VideoStream], *, quiet: bool) -> _Timeline:
    reordered = opened.stream.codec_context.reorder_depth > 0
    if first.pts is None or (opened.container.format.name in _COUNTED_WHEN_REORDERED and reordered):
        if first.pts is None and not quiet:
            log.warning(
                "%s: no time stamps in this file: frames are counted at %g a second",
                opened.container.name,
                opened.fps,
            )
        return _CountedTimeline(opened)
    return _StampedTimeline(opened)


class _StampedTimeline:
    """Finds lost frames by the packets' time stamps.

    After a damaged keyframe a decoder returns nothing until the next one, without an error. ``_spacing``
    separates lost frames from packets without one (VP8's invisible frames have time stamps close to others).
    """

    def __init__(self, opened: OpenedVideo) -> None:
        self._unit = float(opened.stream.time_base or 1)
        self._frame = max(1, round(1 / (opened.fps * self._unit)))
        self._spacing = max(1, self._frame // 2)
        self._awaited: list[int] = []
        self._origin: int | None = None
        self._last: int | None = None

    def decode(self, packet: av.Packet[VideoStream]) -> Iterator[TimedFrame]:
        if packet.pts is not None and not packet.is_discard:
            if self._last is not None and packet.pts < self._last:
                yield self._at(packet.pts, None)  # the decoder had skipped ahead
            else:
                self._awaited.append(packet.pts)
        for picture in _decoded(packet):
            time = picture.pts
            if time is None:
                time = 0 if self._last is None else self._last + self._frame
            if self._last is None or time > self._last:
                yield from self._lost_before(time)
                self._last = time
                yield self._at(time, picture)

    def flush(self) -> Iterator[TimedFrame]:
        if self._awaited:
            yield from self._lost_before(max(self._awaited) + self._spacing)

    def _lost_before(self, time: int) -> Iterator[TimedFrame]:
        earlier = sorted(awaited for awaited in self._awaited if awaited < time)
        self._awaited = [awaited for awaited in self._awaited if awaited > time]
        for lost in earlier:
            after_last = self._last is None or lost - self._last >= self._spacing
            if after_last and time - lost >= self._spacing:
                self._last = lost
                yield self._at(lost, None)

    def _at(self, time: int, picture: VideoFrame | None) -> TimedFrame:
        if self._origin is None:
            self._origin = time
        return TimedFrame((time - self._origin) * self._unit, picture)


@dataclass(frozen=True, slots=True, eq=False)
class _PacketNumber:
    """A packet's number, as an object: PyAV compares such tags by identity."""

    number: int


class _CountedTimeline:
    """Finds lost frames in a file without time stamps, by counting packets at its assumed rate.

    Each decoded picture carries its packet's number. A frame is lost when it is overdue by more than
    reordering allows.
    """

    def __init__(self, opened: OpenedVideo) -> None:
        self._context, self._fps = opened.stream.codec_context, opened.fps
        self._context.copy_opaque = True
        self._awaited: list[int] = []
        self._packets = self._frames = 0

    def decode(self, packet: av.Packet[VideoStream]) -> Iterator[TimedFrame]:
        if packet.size:
            packet.opaque = _PacketNumber(self._packets)
            self._awaited.append(self._packets)
            self._packets += 1
        for picture in _decoded(packet):
            if isinstance(picture.opaque, _PacketNumber):
                number = picture.opaque.number
                if number not in self._awaited:
                    continue  # counted as lost already
                overdue = [
                    awaited for awaited in self._awaited if awaited < number - self._context.reorder_depth
                ]
                self._awaited = [
                    awaited for awaited in self._awaited if awaited not in overdue and awaited != number
                ]
                if not picture.interlaced_frame:  # two packets may be one interlaced frame
                    yield from (self._next(None) for _ in overdue)
            yield self._next(picture)

    def flush(self) -> Iterator[TimedFrame]:
        return (self._next(None) for _ in self._awaited)

    def _next(self, picture: VideoFrame | None) -> TimedFrame:
        self._frames += 1
        return TimedFrame((self._frames - 1) / self._fps, picture)


def _decoded(packet: av.Packet[VideoStream]) -> list[VideoFrame]:
    """Decode a packet; empty where it is damaged."""
    try:
        return [picture for picture in packet.decode() if isinstance(picture, VideoFrame)]
    except av.error.FFmpegError:
        return []


def _packets(opened: OpenedVideo, *, quiet: bool) -> Iterator[av.Packet[VideoStream]]:
    times = TimestampJumpRepair(opened)
    try:
        for packet in opened.container.demux(opened.stream):
            if times.repair_jump(packet) and not quiet:
                log.warning(
                    "%s: its time stamps jump: playback continues across the jump",
                    redact_to_host(opened.container.name),
                )
                quiet = True  # warn only once
            yield packet
    except av.error.FFmpegError as error:
        if error.errno == errno.EINTR:
            raise  # a signal interrupted the read: the file has not ended
        if not quiet:
            log.warning(
                "%s: cannot be read any further: %s", redact_to_host(opened.container.name), reason_of(error)
            )
