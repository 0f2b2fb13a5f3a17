"""The newest GOPs of a stream as segments, and each GOP as a part of one, for players that fetch (HLS).

They are references, not copies. Which segment a GOP is in follows from its pulse alone, and so does the
segment's number. So nothing has to be remembered about who watches, and after a restart of the service the
numbers go on where they were.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

from server.media.containers.fmp4 import Sample, still
from server.service.streaming.media_chunk import MediaChunk


@dataclass(frozen=True)
class HlsPart:
    """One GOP of a segment. ``lead`` is what stands if nothing has been shown in the segment yet."""

    segment: int
    footage: MediaChunk
    lead: MediaChunk | None
    fps: float

    @property
    def independent(self) -> bool:
        """Whether it can be decoded without the parts before."""
        return self.footage.start or self.lead is not None

    @property
    def data(self) -> bytes:
        """The part as fragments of MP4."""
        shown = self.footage
        if self.lead is None:
            return shown.with_sound
        return shown.sound + repeat_last_picture(self.lead, shown.first, shown.until, self.fps)


def repeat_last_picture(lead: MediaChunk, first: int, until: int, fps: float) -> bytes:
    """Show the lead's last picture for some pulses: what it is decoded by passes within a few ticks."""
    samples = [Sample(picture.sample, picture.key) for picture in lead.pictures]
    return still(samples, first, until, fps)


_LEAST_PART_S = 0.1
"""Players ask twice for every part."""


@dataclass(frozen=True, slots=True)
class SegmentLayout:
    """How a site's streams are cut into segments."""

    fps: float
    gop: int
    """Pulses in a GOP."""
    frames: int
    """Pulses in a segment: whole GOPs."""
    listed: int
    """Segments in a playlist."""

    @property
    def has_parts(self) -> bool:
        """Whether a GOP is worth a question of its own."""
        return self.gop / self.fps >= _LEAST_PART_S

    @property
    def target_s(self) -> int:
        """What no segment is longer than, when rounded: the seconds of EXT-X-TARGETDURATION."""
        return max(1, int(self.frames / self.fps + 0.5))


def segment_layout(fps: float, gop: int, segment_s: float, window_s: float) -> SegmentLayout:
    """Plan segments of as many whole GOPs as fit, at least one, and a window of at least three of them."""
    frames = gop * max(1, int(segment_s * fps / gop + 1e-9))
    return SegmentLayout(fps, gop, frames, max(3, -(-int(window_s * fps) // frames)))


class HlsSegment:
    """Consecutive GOPs. It can be decoded without any other segment."""

    def __init__(self, number: int, layout: SegmentLayout, lead: MediaChunk) -> None:
        self.number = number
        self._plan = layout
        self._lead = lead
        """What the first GOP repeats the last picture of, if it repeats one."""
        self._footage: list[MediaChunk] = []

    def add(self, footage: MediaChunk) -> None:
        """Take the next GOP, which has been sent."""
        self._footage.append(footage)

    @property
    def first(self) -> int:
        """The first pulse."""
        return self._footage[0].first

    @property
    def until(self) -> int:
        """The first pulse after it."""
        return self._footage[-1].until

    @property
    def whole(self) -> bool:
        """Whether nothing will be added to it."""
        return self.until >= (self.number + 1) * self._plan.frames

    @property
    def data(self) -> bytes:
        """The segment as fragments of MP4."""
        standing = list(takewhile(lambda it: not it.start, self._footage))
        rest = b"".join(it.with_sound for it in self._footage[len(standing) :])
        heard = b"".join(it.sound for it in standing)
        if not standing:
            return rest
        return heard + repeat_last_picture(self._lead, self.first, standing[-1].until, self._plan.fps) + rest

    @property
    def parts(self) -> Sequence[HlsPart]:
        """The parts that there are by now; none where it is not of whole GOPs, or they are too short."""
        if not self._plan.has_parts:
            return ()
        gop, fps, began = self._plan.gop, self._plan.fps, False
        parts: list[HlsPart] = []
        for it in self._footage:
            if it.first % gop or it.until - it.first != gop:
                return ()
            began |= it.start
            parts.append(HlsPart(self.number, it, None if began else self._lead, fps))
        return parts


class HlsSegmenter:
    """The last segments of one stream: those in the playlist, and those that were until a moment ago."""

    def __init__(self, layout: SegmentLayout) -> None:
        self.plan = layout
        self.ended = False
        self._segments: dict[int, HlsSegment] = {}
        self._lead: MediaChunk | None = None
        self._grown: asyncio.Event | None = None
        """What somebody waits for; None: nobody does."""
        self.until = 0
        """The first pulse that is not here yet."""

    def put(self, footage: MediaChunk) -> None:
        """Take the next GOP."""
        if footage.start:
            self._lead = footage
        if self._lead is None:
            return
        number = footage.first // self.plan.frames
        long = footage.until > (number + 1) * self.plan.frames
        if footage.first != self.until or long:
            self._segments.clear()  # began anew, or nothing came for long: no number is left out
        self.until = footage.until
        if long:
            self._tell()
            return
        if number not in self._segments:
            self._segments[number] = HlsSegment(number, self.plan, self._lead)
        self._segments[number].add(footage)
        # RFC 8216, 6.2.2: what leaves the playlist stays available for as long as the playlist was.
        while next(iter(self._segments)) < number - 2 * self.plan.listed:
            del self._segments[next(iter(self._segments))]
        self._tell()

    def end(self) -> None:
        """Add nothing any more."""
        self.ended = True
        self._tell()

    def _tell(self) -> None:
        if self._grown is not None:
            self._grown.set()
            self._grown = None

    async def more(self) -> None:
        """Wait until there is more, or the end."""
        if self._grown is None:
            self._grown = asyncio.Event()
        await self._grown.wait()

    @property
    def growing(self) -> HlsSegment | None:
        """The segment that is not whole yet; None where there is nothing of it."""
        newest = next(reversed(self._segments.values()), None)
        return None if newest is None or self._is_listed(newest) else newest

    def part(self, number: int, index: int) -> HlsPart | None:
        """Give a part of a segment, which need not be whole."""
        segment = self._segments.get(number)
        parts = () if segment is None else segment.parts
        return parts[index] if index < len(parts) else None

    def reaches(self, number: int, index: int | None) -> bool:
        """Tell whether a segment is here as a whole; or, with ``index``, that part of it or what follows."""
        frames, gop = self.plan.frames, self.plan.gop
        if index is None:
            return self.until >= (number + 1) * frames
        return self.until >= number * frames + min((index + 1) * gop, frames + gop)

    def get(self, number: int) -> HlsSegment | None:
        """Give a segment that is or was in the playlist."""
        segment = self._segments.get(number)
        return segment if segment is not None and self._is_listed(segment) else None

    @property
    def listed(self) -> Sequence[HlsSegment]:
        """The segments of the playlist, in order."""
        return [it for it in self._segments.values() if self._is_listed(it)][-self.plan.listed :]

    def _is_listed(self, segment: HlsSegment) -> bool:
        return segment.whole or self.ended
