"""A stream that begins in the past: paced as it was, and the live stream from where it meets the present."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from dataclasses import dataclass

from server.view.channel import Channel
from server.view.past.media import Gop, fragments, is_key, pulse_of
from server.view.past.play import Source, play
from server.view.picture import Picture
from server.view.timeline import Timeline

_LEAD_S = 4.0
"""Seconds of the past that are sent at once: what a player likes to have before it begins."""
_LATE_S = 1.0
"""Seconds for which pictures of a time that is decided may still come."""


@dataclass(frozen=True, slots=True)
class Wish:
    """What somebody wants to see: pulses ``start … end - 1``; without an end it goes on with the present."""

    start: int
    end: int | None = None


class PastStream:
    """The bytes of one viewer's stream, without a hole in its time.

    ``live`` gives the stream's channel when the present is reached; None: there is none any more.
    """

    def __init__(
        self,
        source: Source,
        timeline: Timeline,
        fps: float,
        live: Callable[[], Channel | None],
    ) -> None:
        self._source, self._timeline, self._fps, self._live = source, timeline, fps, live

    async def send(self, wish: Wish) -> AsyncGenerator[bytes, None]:
        """Give the past in real time after its first seconds; where it has an end, as fast as it is read."""
        at, pace = wish.start, _Pace(_LEAD_S)
        async with aclosing(play(self._source, wish.start)) as gops:
            async for gop in gops:
                if wish.end is not None and gop.first >= wish.end:
                    return
                data = self._filled(gop, wish.end)
                if wish.end is None:
                    await pace.wait(len(gop.fragments) / self._fps)
                yield data
                at = gop.end
        if wish.end is not None and max(at, self._source.end - _LATE_S * self._fps) >= wish.end:
            return  # of that time nothing more will come
        channel = self._live()
        if channel is not None:  # nothing was awaited since the newest GOP: none can have come between
            async with aclosing(self._joined(channel, at, wish.end)) as joined:
                async for data in joined:
                    yield data

    async def _joined(self, channel: Channel, at: int, end: int | None) -> AsyncGenerator[bytes, None]:
        viewer = channel.join()
        begun = False
        try:
            async for piece in viewer.pieces():
                shown = fragments(piece.data)
                if not begun:
                    shown = [it for it in shown if pulse_of(it, self._fps) >= at]
                    if not shown:
                        continue
                    begun = True
                    if end is not None and pulse_of(shown[0], self._fps) >= end:
                        return
                    filled = self._timeline.fill(pulse_of(shown[0], self._fps))
                    shown = [*(picture.fragment for picture in filled), *shown]
                if end is not None and pulse_of(shown[-1], self._fps) >= end:
                    yield b"".join(it for it in shown if pulse_of(it, self._fps) < end)
                    return
                yield b"".join(shown)
        finally:
            channel.leave(viewer)

    def _filled(self, gop: Gop, end: int | None) -> bytes:
        """Give a GOP's fragments before an end, and what repeats the picture before it up to there."""
        shown = []
        for number, fragment in enumerate(gop.fragments):
            if end is None or gop.first + number < end:
                picture = Picture(gop.first + number, is_key(fragment), fragment, boot=0)
                shown += self._timeline.take(picture)
        return b"".join(picture.fragment for picture in shown)


class _Pace:
    """Lets ``lead_s`` seconds of media through at once, the rest in real time."""

    def __init__(self, lead_s: float) -> None:
        self._clock = asyncio.get_running_loop().time
        self._due = self._clock() - lead_s

    async def wait(self, seconds: float) -> None:
        """Wait until the next ``seconds`` of media may be sent."""
        await asyncio.sleep(max(0.0, self._due - self._clock()))
        self._due += seconds
