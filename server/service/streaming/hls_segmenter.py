"""Cuts one stream into HLS segments and parts (RFC 8216 and its low-latency successor).

Segments and parts refer to the stream's chunks; nothing is copied. The number of a segment follows from its
pulses alone: there is no state per viewer, and after a restart of the service the numbers continue.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

from server.media.containers.fmp4 import FragmentSample, still_fragment
from server.service.streaming.media_chunk import MediaChunk

_SHORTEST_PART_S = 0.1
"""Players send two requests for every part."""


@dataclass(frozen=True, slots=True)
class SegmentLayout:
    """How a site's streams are cut into segments."""

    fps: float
    gop: int
    """Pulses in a GOP."""
    segment_frames: int
    """Pulses in a segment: whole GOPs."""
    playlist_length: int
    """Segments in a playlist."""

    @property
    def has_parts(self) -> bool:
        """Whether a GOP is long enough for a request of its own."""
        return self.gop / self.fps >= _SHORTEST_PART_S

    @property
    def target_s(self) -> int:
        """The longest rounded duration of a segment: EXT-X-TARGETDURATION in seconds."""
        return max(1, int(self.segment_frames / self.fps + 0.5))


def segment_layout(fps: float, gop: int, segment_s: float, window_s: float) -> SegmentLayout:
    """Return the layout: as many whole GOPs per segment as fit, and at least three segments."""
    frames = gop * max(1, int(segment_s * fps / gop + 1e-9))
    return SegmentLayout(fps, gop, frames, max(3, -(-int(window_s * fps) // frames)))


@dataclass(frozen=True)
class HlsPart:
    """One GOP of a segment, which low-latency players fetch before the segment is complete.

    ``lead`` holds the picture to repeat if no picture was shown in the segment yet.
    """

    segment: int
    chunk: MediaChunk
    lead: MediaChunk | None
    fps: float

    @property
    def independent(self) -> bool:
        """Whether it can be decoded without the parts before it (INDEPENDENT=YES)."""
        return self.chunk.random_access or self.lead is not None

    @property
    def data(self) -> bytes:
        """The part as MP4 fragments."""
        chunk = self.chunk
        if self.lead is None:
            return chunk.data_with_audio
        return chunk.audio_fragment + repeat_last_picture(self.lead, chunk.first, chunk.until, self.fps)


def repeat_last_picture(lead: MediaChunk, first: int, until: int, fps: float) -> bytes:
    """Return a fragment that shows the last picture of ``lead`` during the pulses ``first … until - 1``.

    The pictures that it is decoded from are in it, too, and last a few clock ticks.
    """
    samples = [FragmentSample(picture.sample, picture.key) for picture in lead.pictures]
    return still_fragment(samples, first, until, fps)


class HlsSegment:
    """Consecutive GOPs that can be decoded without any other segment."""

    def __init__(self, number: int, layout: SegmentLayout, lead: MediaChunk) -> None:
        self.number = number
        self._layout = layout
        self._lead = lead
        """The chunk whose last picture the first GOP repeats, if it repeats one."""
        self._chunks: list[MediaChunk] = []

    def add(self, chunk: MediaChunk) -> None:
        """Add the next GOP of the stream."""
        self._chunks.append(chunk)

    @property
    def first(self) -> int:
        """The first pulse."""
        return self._chunks[0].first

    @property
    def until(self) -> int:
        """The pulse after the last."""
        return self._chunks[-1].until

    @property
    def is_complete(self) -> bool:
        """Whether all its GOPs are there."""
        return self.until >= (self.number + 1) * self._layout.segment_frames

    @property
    def data(self) -> bytes:
        """The segment as MP4 fragments."""
        filler = list(takewhile(lambda chunk: not chunk.random_access, self._chunks))
        following = b"".join(chunk.data_with_audio for chunk in self._chunks[len(filler) :])
        audio = b"".join(chunk.audio_fragment for chunk in filler)
        if not filler:
            return following
        return (
            audio
            + repeat_last_picture(self._lead, self.first, filler[-1].until, self._layout.fps)
            + following
        )

    @property
    def parts(self) -> Sequence[HlsPart]:
        """The parts so far; none if GOPs are too short for parts, or the segment has partial GOPs."""
        if not self._layout.has_parts:
            return ()
        gop, fps, has_started = self._layout.gop, self._layout.fps, False
        parts: list[HlsPart] = []
        for chunk in self._chunks:
            if chunk.first % gop or chunk.until - chunk.first != gop:
                return ()
            has_started |= chunk.random_access
            parts.append(HlsPart(self.number, chunk, None if has_started else self._lead, fps))
        return parts


class HlsSegmenter:
    """The last segments of one stream: those in the playlist, and those that recently left it."""

    def __init__(self, layout: SegmentLayout) -> None:
        self.layout = layout
        self.has_ended = False
        self._segments: dict[int, HlsSegment] = {}
        self._lead: MediaChunk | None = None
        self._updated: asyncio.Event | None = None
        """Set at the next change; None: nothing waits for it."""
        self.until = 0
        """The first pulse that is not here yet."""

    def put(self, chunk: MediaChunk) -> None:
        """Add the next GOP."""
        if chunk.random_access:
            self._lead = chunk
        if self._lead is None:
            return
        number = chunk.first // self.layout.segment_frames
        is_long = chunk.until > (number + 1) * self.layout.segment_frames
        if chunk.first != self.until or is_long:
            self._segments.clear()  # the pulses have restarted, or a long gap: numbers must not be skipped
        self.until = chunk.until
        if is_long:
            self._notify()
            return
        if number not in self._segments:
            self._segments[number] = HlsSegment(number, self.layout, self._lead)
        self._segments[number].add(chunk)
        # RFC 8216, 6.2.2: a segment stays available for a playlist's duration after it left the playlist.
        while next(iter(self._segments)) < number - 2 * self.layout.playlist_length:
            del self._segments[next(iter(self._segments))]
        self._notify()

    def end(self) -> None:
        """End the stream."""
        self.has_ended = True
        self._notify()

    def _notify(self) -> None:
        if self._updated is not None:
            self._updated.set()
            self._updated = None

    async def wait_for_update(self) -> None:
        """Wait until a GOP is added or the stream ends."""
        if self._updated is None:
            self._updated = asyncio.Event()
        await self._updated.wait()

    @property
    def open_segment(self) -> HlsSegment | None:
        """The segment that is not complete yet; None if it has no GOP."""
        newest = next(reversed(self._segments.values()), None)
        return None if newest is None or self._is_listed(newest) else newest

    def part(self, number: int, index: int) -> HlsPart | None:
        """Return a part of a segment, which may be the open one; None if there is no such part."""
        segment = self._segments.get(number)
        parts = () if segment is None else segment.parts
        return parts[index] if index < len(parts) else None

    def has_reached(self, number: int, index: int | None) -> bool:
        """Return whether a segment is complete or, with ``index``, that part of it or a later one is here."""
        frames, gop = self.layout.segment_frames, self.layout.gop
        if index is None:
            return self.until >= (number + 1) * frames
        return self.until >= number * frames + min((index + 1) * gop, frames + gop)

    def listed_segment(self, number: int) -> HlsSegment | None:
        """Return a segment that is or was in the playlist."""
        segment = self._segments.get(number)
        return segment if segment is not None and self._is_listed(segment) else None

    @property
    def playlist_segments(self) -> Sequence[HlsSegment]:
        """The segments of the playlist, in order."""
        listed = [segment for segment in self._segments.values() if self._is_listed(segment)]
        return listed[-self.layout.playlist_length :]

    def _is_listed(self, segment: HlsSegment) -> bool:
        return segment.is_complete or self.has_ended
