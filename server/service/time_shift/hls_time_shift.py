"""Time shift by HLS: recorded segments, cut and numbered by pulses like the live ones.

So a segment has the same URL while it is live and later, and a player of the past reaches the present.
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
from server.service.time_shift.playback import PlaybackSource, last_gop_until, play_gops
from server.service.time_shift.playback_audio import PlaybackAudio
from server.service.time_shift.presence_history import visible_pictures


@dataclass(frozen=True, slots=True)
class SegmentList:
    """The segments of a playlist: ``frames`` pulses each, as far as they are in ``first … until - 1``."""

    numbers: range
    frames: int
    first: int
    until: int

    def pulses_of(self, number: int) -> range:
        """Return the pulses of a segment."""
        begin = number * self.frames
        return range(max(self.first, begin), min(self.until, begin + self.frames))

    @property
    def end(self) -> int:
        """The pulse after the last segment."""
        return self.pulses_of(self.numbers[-1]).stop

    def since(self, number: int) -> SegmentList:
        """Return the list without the segments before one."""
        return replace(self, numbers=range(max(number, self.numbers.start), self.numbers.stop))


class TimeShift:
    """One stream's recorded segments; ``timeline`` and ``audio`` return new ones for each segment.

    ``gop`` is the length of a GOP in pulses, ``decided`` the pulse after the newest decided one;
    ``has_ended``: the stream gets no new pictures.
    """

    def __init__(
        self,
        source: PlaybackSource,
        layout: SegmentLayout,
        timeline: Callable[[], GaplessTimeline],
        audio: Callable[[], PlaybackAudio | None],
        *,
        gop: int,
        decided: int,
        has_ended: bool,
    ) -> None:
        self._source, self._layout, self._gop = source, layout, gop
        self._timeline, self._audio = timeline, audio
        self.has_ended = has_ended
        self.end = min(decided, end_of_available(source)) if has_ended else decided
        """The pulse after the last that can be played."""

    def segments(self, start: int, end: int | None) -> SegmentList | None:
        """Return the segments from the one that holds pulse ``start``, or the first after it, to the end.

        Only complete ones, and the last one of a stream that has ended. No number is skipped: in gaps the
        last picture is repeated. None if there is no segment.
        """
        frames = self._layout.segment_frames
        begin, earliest = first_available(self._source, start), first_available(self._source, 0)
        if begin is None or earliest is None:
            return None
        last = -(-self.end // frames) if self.has_ended else self.end // frames
        last = last if end is None else min(last, -(-end // frames))
        numbers = range(begin // frames, last)
        return SegmentList(numbers, frames, earliest, self.end) if numbers else None

    async def build_segment(self, number: int) -> HlsSegment | None:
        """Return a segment; None if it is not complete yet, or there is no picture in or before it."""
        first, until = number * self._layout.segment_frames, (number + 1) * self._layout.segment_frames
        until = min(until, self.end) if self.has_ended else until
        if not first < until <= self.end:
            return None
        lead = await last_gop_until(self._source, first)
        timeline, playback_audio = self._timeline(), self._audio()
        stream_format = timeline.stream_format
        lead_pictures = (
            []
            if lead is None
            else (await visible_pictures(lead, self._source, stream_format, self._layout.fps)).pictures
        )
        if lead_pictures:  # with a recent time: a repetition does not depend on its age
            timeline.record_shown(replace(lead_pictures[-1], pulse=first - 1))
        arrived, audible = await self._read(first, until, stream_format)
        chunks: list[MediaChunk] = []
        for begin in range(first, until, self._gop):
            end = min(begin + self._gop, until)
            pictures = [
                picture for one in arrived if begin <= one.pulse < end for picture in timeline.push(one)
            ]
            pictures += timeline.fill(end)
            if pictures:
                audio = None if playback_audio is None else await playback_audio.next_audio(begin, end)
                if audio is not None and self._source.presence is not None and begin not in audible:
                    audio = audio.silenced
                chunks.append(MediaChunk(pictures, self._layout.fps, ContinuityCounters(), audio=audio))
        if not chunks:
            return None
        fps = self._layout.fps
        lead_chunk = MediaChunk(lead_pictures, fps, ContinuityCounters()) if lead_pictures else chunks[0]
        segment = HlsSegment(number, self._layout, lead_chunk)
        for chunk in chunks:
            segment.add(chunk)
        return segment

    async def _read(
        self, first: int, until: int, stream_format: StreamFormat
    ) -> tuple[list[EncodedPicture], frozenset[int]]:
        """Return the pictures of some pulses, and the first pulses of GOPs whose audio may be heard."""
        arrived: list[EncodedPicture] = []
        audible: set[int] = set()
        async with aclosing(play_gops(self._source, first)) as gops:
            async for gop in gops:
                if gop.first >= until:
                    break
                shown = await visible_pictures(gop, self._source, stream_format, self._layout.fps)
                arrived += shown.pictures
                if not shown.is_muted:
                    audible.add(gop.first)
        return arrived, frozenset(audible)
