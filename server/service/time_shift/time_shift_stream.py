"""A continuous stream that begins in the past: played at its own rate, then the live stream."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Callable, Iterator
from contextlib import aclosing
from dataclasses import dataclass

from server.media.audio.audio_chunk import AudioChunk
from server.media.picture import EncodedPicture
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.gapless_timeline import LONGEST_GAP_S, GaplessTimeline
from server.service.streaming.media_chunk import MediaChunk, TsContinuity
from server.service.time_shift.playback import PlaybackSource, play_gops
from server.service.time_shift.playback_audio import PlaybackAudio
from server.service.time_shift.presence_history import VisiblePictures, visible_pictures

_LEAD_S = 4.0
"""Seconds that are sent at once: what a player buffers before it starts."""
_FILL_STEP_S = 4.0
"""A gap is filled so many seconds at a time."""
_LATE_S = 1.0
"""Seconds for which pictures of a decided time may still arrive."""


@dataclass(frozen=True, slots=True)
class PlaybackRange:
    """The requested pulses ``start … end - 1``; without an end, the live stream follows."""

    start: int
    end: int | None = None


class TimeShiftStream:
    """One subscriber's stream, without a gap in its time.

    ``live`` returns the live stream when the present is reached; None: it has ended. ``audio`` is None if
    the site has no audio.
    """

    def __init__(
        self,
        source: PlaybackSource,
        timeline: GaplessTimeline,
        fps: float,
        live: Callable[[], Broadcaster | None],
        audio: PlaybackAudio | None = None,
    ) -> None:
        self._source, self._timeline, self._fps, self._live = source, timeline, fps, live
        self._audio = audio
        self._ts = TsContinuity(fps)

    async def send(self, requested: PlaybackRange) -> AsyncGenerator[MediaChunk, None]:
        """Yield the chunks, in real time after the first seconds; as fast as possible if there is an end."""
        at, pace = requested.start, _RealTimePacer(_LEAD_S)
        async with aclosing(play_gops(self._source, requested.start)) as gops:
            async for gop in gops:
                if requested.end is not None and gop.first >= requested.end:
                    return
                visible = await visible_pictures(gop, self._source, self._timeline.stream_format, self._fps)
                pictures = [
                    picture
                    for picture in visible.pictures
                    if requested.end is None or picture.pulse < requested.end
                ]
                for shown in self._decodable(VisiblePictures(pictures, visible.is_muted)):
                    chunk = await self._recorded_chunk(shown)
                    if requested.end is None:
                        await pace.wait((chunk.until - chunk.first) / self._fps)
                    yield chunk
                at = gop.end
        if requested.end is not None and max(at, self._source.end - _LATE_S * self._fps) >= requested.end:
            return  # no more pictures of that time will arrive
        broadcaster = self._live()
        if broadcaster is not None:  # nothing was awaited since the newest GOP: none is missed
            async with aclosing(self._live_chunks(broadcaster, at, requested.end)) as joined:
                async for chunk in joined:
                    yield chunk

    async def _live_chunks(
        self, broadcaster: Broadcaster, at: int, end: int | None
    ) -> AsyncGenerator[MediaChunk, None]:
        subscriber = broadcaster.subscribe()
        has_started = False
        try:
            async for chunk in subscriber.chunks():
                visible = chunk.pictures if isinstance(chunk, MediaChunk) else ()
                pictures = [picture for picture in visible if has_started or picture.pulse >= at]
                if not pictures:
                    continue
                is_last = end is not None and pictures[-1].until >= end
                pictures = [picture for picture in pictures if end is None or picture.pulse < end]
                if not has_started and pictures:
                    for shown in self._filler(pictures[0].pulse):
                        yield await self._recorded_chunk(shown)
                    has_started = True
                if pictures:
                    yield self._live_chunk(
                        pictures, is_muted=isinstance(chunk, MediaChunk) and chunk.is_muted
                    )
                if is_last:
                    return
        finally:
            broadcaster.unsubscribe(subscriber)

    def _decodable(self, gop: VisiblePictures) -> Iterator[VisiblePictures]:
        """Yield a GOP's decodable pictures, behind the filler of a gap before them."""
        if not gop.pictures:
            return
        yield from self._filler(gop.pictures[0].pulse)
        shown = [shown_picture for picture in gop.pictures for shown_picture in self._timeline.push(picture)]
        if shown:
            yield VisiblePictures(shown, gop.is_muted)

    def _filler(self, until: int) -> Iterator[VisiblePictures]:
        """Yield repetitions of the last picture up to a pulse, a few seconds at a time.

        They are muted for viewers with access to one person: nothing of that person was recorded then.
        """
        max_step = round(_FILL_STEP_S * self._fps)
        while (at := self._timeline.until) is not None and at < until <= at + LONGEST_GAP_S * self._fps:
            shown = self._timeline.fill(min(until, at + max_step))
            if not shown:
                return
            yield VisiblePictures(shown, is_muted=self._source.presence is not None)

    async def _recorded_chunk(self, shown: VisiblePictures) -> MediaChunk:
        playback_audio, first, until = self._audio, shown.pictures[0].pulse, shown.pictures[-1].until
        audio = None if playback_audio is None else await playback_audio.next_audio(first, until)
        return self._chunk(shown.pictures, audio, is_muted=shown.is_muted)

    def _live_chunk(self, pictures: list[EncodedPicture], *, is_muted: bool) -> MediaChunk:
        playback_audio, first, until = self._audio, pictures[0].pulse, pictures[-1].until
        audio = None if playback_audio is None else playback_audio.live(first, until)
        return self._chunk(pictures, audio, is_muted=is_muted)

    def _chunk(
        self, pictures: list[EncodedPicture], audio: AudioChunk | None, *, is_muted: bool
    ) -> MediaChunk:
        return self._ts.chunk(pictures, audio.silenced if is_muted and audio is not None else audio)


class _RealTimePacer:
    """Lets ``lead_s`` seconds of media pass at once, and the remainder in real time."""

    def __init__(self, lead_s: float) -> None:
        self._clock = asyncio.get_running_loop().time
        self._due = self._clock() - lead_s

    async def wait(self, seconds: float) -> None:
        """Wait until the next ``seconds`` of media may be sent."""
        await asyncio.sleep(max(0.0, self._due - self._clock()))
        self._due += seconds
