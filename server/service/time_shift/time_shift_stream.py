"""A stream that begins in the past: paced as it was, and the live stream from where it meets the present."""

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
"""Seconds of the past that are sent at once: what a player likes to have before it begins."""
_BRIDGED_S = 4.0
"""A hole is bridged so many seconds at a time."""
_LATE_S = 1.0
"""Seconds for which pictures of a time that is decided may still come."""


@dataclass(frozen=True, slots=True)
class PlaybackRange:
    """What somebody wants to see: pulses ``start … end - 1``; without an end it goes on with the present."""

    start: int
    end: int | None = None


class TimeShiftStream:
    """One viewer's stream, without a hole in its time.

    ``live`` gives the stream's channel when the present is reached; None: there is none any more. ``hearing``
    is None at a site without sound.
    """

    def __init__(
        self,
        source: PlaybackSource,
        timeline: GaplessTimeline,
        fps: float,
        live: Callable[[], Broadcaster | None],
        hearing: PlaybackAudio | None = None,
    ) -> None:
        self._source, self._timeline, self._fps, self._live = source, timeline, fps, live
        self._hearing = hearing
        self._tally = TsContinuity(fps)

    async def send(self, wish: PlaybackRange) -> AsyncGenerator[MediaChunk, None]:
        """Give the past in real time after its first seconds; where it has an end, as fast as it is read."""
        at, pace = wish.start, _RealTimePacer(_LEAD_S)
        async with aclosing(play_gops(self._source, wish.start)) as gops:
            async for gop in gops:
                if wish.end is not None and gop.first >= wish.end:
                    return
                came = await visible_pictures(gop, self._source, self._timeline.agreement, self._fps)
                pictures = [it for it in came.pictures if wish.end is None or it.pulse < wish.end]
                for shown in self._shown(VisiblePictures(pictures, came.silent)):
                    footage = await self._recalled(shown)
                    if wish.end is None:
                        await pace.wait((footage.until - footage.first) / self._fps)
                    yield footage
                at = gop.end
        if wish.end is not None and max(at, self._source.end - _LATE_S * self._fps) >= wish.end:
            return  # of that time nothing more will come
        channel = self._live()
        if channel is not None:  # nothing was awaited since the newest GOP: none can have come between
            async with aclosing(self._joined(channel, at, wish.end)) as joined:
                async for footage in joined:
                    yield footage

    async def _joined(
        self, channel: Broadcaster, at: int, end: int | None
    ) -> AsyncGenerator[MediaChunk, None]:
        viewer = channel.subscribe()
        begun = False
        try:
            async for piece in viewer.chunks():
                came = piece.pictures if isinstance(piece, MediaChunk) else ()
                pictures = [it for it in came if begun or it.pulse >= at]
                if not pictures:
                    continue
                over = end is not None and pictures[-1].until >= end
                pictures = [it for it in pictures if end is None or it.pulse < end]
                if not begun and pictures:
                    for shown in self._bridged(pictures[0].pulse):
                        yield await self._recalled(shown)
                    begun = True
                if pictures:
                    yield self._present(pictures, silent=isinstance(piece, MediaChunk) and piece.is_muted)
                if over:
                    return
        finally:
            channel.unsubscribe(viewer)

    def _shown(self, gop: VisiblePictures) -> Iterator[VisiblePictures]:
        """Give a GOP's pictures as they can be shown, behind what repeats the picture before them."""
        if not gop.pictures:
            return
        yield from self._bridged(gop.pictures[0].pulse)
        shown = [it for picture in gop.pictures for it in self._timeline.push(picture)]
        if shown:
            yield VisiblePictures(shown, gop.silent)

    def _bridged(self, until: int) -> Iterator[VisiblePictures]:
        """Repeat the last picture up to a pulse, a few seconds at a time: sound goes on meanwhile.

        Not for who may see one person alone, of whom nothing was kept then.
        """
        most = round(_BRIDGED_S * self._fps)
        while (at := self._timeline.until) is not None and at < until <= at + LONGEST_GAP_S * self._fps:
            shown = self._timeline.fill(min(until, at + most))
            if not shown:
                return
            yield VisiblePictures(shown, silent=self._source.presence is not None)

    async def _recalled(self, shown: VisiblePictures) -> MediaChunk:
        hearing, first, until = self._hearing, shown.pictures[0].pulse, shown.pictures[-1].until
        heard = None if hearing is None else await hearing.beside(first, until)
        return self._footage(shown.pictures, heard, silent=shown.silent)

    def _present(self, pictures: list[EncodedPicture], *, silent: bool) -> MediaChunk:
        hearing, first, until = self._hearing, pictures[0].pulse, pictures[-1].until
        heard = None if hearing is None else hearing.live(first, until)
        return self._footage(pictures, heard, silent=silent)

    def _footage(
        self, pictures: list[EncodedPicture], heard: AudioChunk | None, *, silent: bool
    ) -> MediaChunk:
        return self._tally.chunk(pictures, heard.silenced if silent and heard is not None else heard)


class _RealTimePacer:
    """Lets ``lead_s`` seconds of media through at once, the rest in real time."""

    def __init__(self, lead_s: float) -> None:
        self._clock = asyncio.get_running_loop().time
        self._due = self._clock() - lead_s

    async def wait(self, seconds: float) -> None:
        """Wait until the next ``seconds`` of media may be sent."""
        await asyncio.sleep(max(0.0, self._due - self._clock()))
        self._due += seconds
