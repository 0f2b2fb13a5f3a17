"""The pictures of a recording one by one, each in its own place however damaged the file is."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import av
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from server.camera.sources.opening import Opened
from server.wire.addresses import shown

log = logging.getLogger(__name__)


def pictures(opened: Opened, *, again: bool = False) -> Iterator[VideoFrame | None]:
    """Give the pictures in order; None stands for one that could not be decoded.

    A file that cannot be read any further ends there, and that is said; not where it is read ``again``.
    """
    line = _Line(_half_a_frame(opened.stream))
    for packet in _packets(opened, again=again):
        yield from line.after(packet)
    yield from line.rest()


class _Line:
    """Which pictures are to come, by the packets' times, so that one that never comes leaves a gap.

    After a damaged key frame a decoder keeps silent until the next one, without an error. ``spacing`` tells
    lost pictures from packets that never were pictures (VP8's invisible ones are stamped beside others).
    """

    def __init__(self, spacing: int) -> None:
        self._spacing = spacing
        self._awaited: list[int] = []
        self._last: int | None = None

    def after(self, packet: av.Packet[VideoStream]) -> Iterator[VideoFrame | None]:
        """Give what is known to come next now that this packet was decoded."""
        timed = packet.pts is not None
        if packet.pts is not None and not packet.is_discard:
            if self._last is not None and packet.pts < self._last:
                yield None  # a later picture was shown already: a decoder that has lost its thread
            else:
                self._awaited.append(packet.pts)
        try:
            found = [picture for picture in packet.decode() if isinstance(picture, VideoFrame)]
        except av.error.FFmpegError:
            if not timed:
                yield None
            return
        for picture in found:
            if picture.pts is None:
                yield picture
            elif self._last is None or picture.pts > self._last:
                yield from self._lost_before(picture.pts)
                self._last = picture.pts
                yield picture

    def rest(self) -> Iterator[None]:
        """Give what never came at the end."""
        if self._awaited:
            yield from self._lost_before(max(self._awaited) + self._spacing)

    def _lost_before(self, time: int) -> Iterator[None]:
        earlier = sorted(awaited for awaited in self._awaited if awaited < time)
        self._awaited = [awaited for awaited in self._awaited if awaited > time]
        for lost in earlier:
            after_last = self._last is None or lost - self._last >= self._spacing
            if after_last and time - lost >= self._spacing:
                self._last = lost
                yield None


def _packets(opened: Opened, *, again: bool) -> Iterator[av.Packet[VideoStream]]:
    try:
        yield from opened.container.demux(opened.stream)
    except av.error.FFmpegError as error:
        if not again:
            log.warning("%s: cannot be read any further: %s", shown(opened.container.name), error.strerror)


def _half_a_frame(stream: VideoStream) -> int:
    """Give half the time of a frame in the stream's units, at least one."""
    if not stream.average_rate or not stream.time_base:
        return 1
    return max(1, int(1 / (2 * stream.average_rate * stream.time_base)))
