"""The past in segments (HLS), cut and numbered by pulses as the live ones are (`streams/reel.py`).

So a segment has one address, whether it is new or long past, and who plays the past comes to the present.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import aclosing
from dataclasses import dataclass, replace

from server.media.containers.mpegts import ContinuityCounters
from server.media.picture import EncodedPicture
from server.media.stream_format import StreamFormat
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.hls_segmenter import HlsSegment, SegmentLayout
from server.service.streaming.media_chunk import MediaChunk
from server.service.time_shift.availability import end_of_available, first_available
from server.service.time_shift.playback import PlaybackSource, last_gop_before, play_gops
from server.service.time_shift.playback_audio import PlaybackAudio
from server.service.time_shift.presence_history import visible_pictures


@dataclass(frozen=True, slots=True)
class SegmentList:
    """Consecutive segments of ``frames`` pulses, as far as they are in ``first … until - 1``."""

    numbers: range
    frames: int
    first: int
    until: int

    def pulses_of(self, number: int) -> range:
        """Give the pulses of one of them."""
        begin = number * self.frames
        return range(max(self.first, begin), min(self.until, begin + self.frames))

    @property
    def end(self) -> int:
        """The pulse after the last segment's last."""
        return self.pulses_of(self.numbers[-1]).stop

    def since(self, number: int) -> SegmentList:
        """Leave out those before one."""
        return replace(self, numbers=range(max(number, self.numbers.start), self.numbers.stop))


class TimeShift:
    """One stream's past, in GOPs of ``gop`` pulses; ``timeline`` and ``hearing`` are asked for each segment.

    ``decided`` is the pulse after the newest that a segment can have; ``over``: nothing follows what is kept.
    """

    def __init__(
        self,
        source: PlaybackSource,
        plan: SegmentLayout,
        timeline: Callable[[], GaplessTimeline],
        hearing: Callable[[], PlaybackAudio | None],
        *,
        gop: int,
        decided: int,
        over: bool,
    ) -> None:
        self._source, self._plan, self._gop = source, plan, gop
        self._timeline, self._hearing = timeline, hearing
        self.over = over
        self.end = min(decided, end_of_available(source)) if over else decided
        """The pulse after the last that there is, or will ever be where it is over."""

    def listing(self, start: int, end: int | None) -> SegmentList | None:
        """List the segments from the one that holds pulse ``start``, or what is kept after it, to the end.

        Only whole ones, and the last one where it is over. In between, the last picture stands where
        nothing was shown: no number is left out. None where there is none.
        """
        frames = self._plan.segment_frames
        begin, earliest = first_available(self._source, start), first_available(self._source, 0)
        if begin is None or earliest is None:
            return None
        last = -(-self.end // frames) if self.over else self.end // frames
        last = last if end is None else min(last, -(-end // frames))
        numbers = range(begin // frames, last)
        return SegmentList(numbers, frames, earliest, self.end) if numbers else None

    async def segment(self, number: int) -> HlsSegment | None:
        """Put a segment together; None where it is not whole yet, or nothing is kept of it or before it."""
        first, until = number * self._plan.segment_frames, (number + 1) * self._plan.segment_frames
        until = min(until, self.end) if self.over else until
        if not first < until <= self.end:
            return None
        lead = await last_gop_before(self._source, first)
        timeline, hearing = self._timeline(), self._hearing()
        agreement = timeline.agreement
        led = (
            []
            if lead is None
            else (await visible_pictures(lead, self._source, agreement, self._plan.fps)).pictures
        )
        if led:  # as if it had been shown just now: what repeats it does not say how old it is
            timeline.advance_past(replace(led[-1], pulse=first - 1))
        came, heard_from = await self._came(first, until, agreement)
        footage: list[MediaChunk] = []
        for begin in range(first, until, self._gop):
            end = min(begin + self._gop, until)
            pictures = [it for one in came if begin <= one.pulse < end for it in timeline.push(one)]
            pictures += timeline.fill(end)
            if pictures:
                heard = None if hearing is None else await hearing.beside(begin, end)
                if heard is not None and self._source.presence is not None and begin not in heard_from:
                    heard = heard.silenced
                footage.append(MediaChunk(pictures, self._plan.fps, ContinuityCounters(), audio=heard))
        if not footage:
            return None
        lead_footage = MediaChunk(led, self._plan.fps, ContinuityCounters()) if led else footage[0]
        segment = HlsSegment(number, self._plan, lead_footage)
        for it in footage:
            segment.add(it)
        return segment

    async def _came(
        self, first: int, until: int, agreement: StreamFormat
    ) -> tuple[list[EncodedPicture], frozenset[int]]:
        """Give the pictures that there are of some pulses, and the first pulses of GOPs that may be heard."""
        came: list[EncodedPicture] = []
        heard_from: set[int] = set()
        async with aclosing(play_gops(self._source, first)) as gops:
            async for gop in gops:
                if gop.first >= until:
                    break
                shown = await visible_pictures(gop, self._source, agreement, self._plan.fps)
                came += shown.pictures
                if not shown.silent:
                    heard_from.add(gop.first)
        return came, frozenset(heard_from)
