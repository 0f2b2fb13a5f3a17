"""View history of a stream from the server's events: the camera shown, and the boxes in its pictures."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from bisect import bisect_right, insort
from collections.abc import AsyncIterator, Iterator, Sequence
from dataclasses import dataclass

import msgspec

from client.api import past, site
from client.events import events
from client.http import ClientError, HttpSettings
from client.model import Box, Event, Gop, Objects, PersonElsewhere, Site
from client.spool import Place, Spool

_log = logging.getLogger(__name__)
_MAX_GOPS = 64  # kept if nothing is recorded; far more than the stream lags behind the events
_TIMEOUT_S = 1.0


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame of a stream: its camera and its boxes."""

    pulse: int
    camera: str
    boxes: tuple[Box, ...]


@dataclass(frozen=True, slots=True)
class _Shown:
    frames: int
    camera: str | None
    boxes: Place | None
    """In MessagePack, 38 bytes a box and frame; None if unknown or not stored."""


class ViewHistory:
    """The views of one object: the newest ones, or with a ``spool`` all of them and their boxes."""

    def __init__(self, number: int, *, spool: Spool | None = None) -> None:
        self.number = number
        self.site: Site | None = None
        self.elsewhere: PersonElsewhere | None = None
        """Where they are, if another site or area sees the object now."""
        self._numbers = {number}
        """The object's, with those that the server last said are merged with it."""
        self._spool = spool
        self._firsts: list[int] = []
        self._shown: dict[int, _Shown] = {}
        self._updated = asyncio.Event()

    def take(self, event: Event) -> None:
        """Take an event."""
        if isinstance(event, Site):
            self.site = event
        elif isinstance(event, Gop):
            self._take_gop(event)
        elif isinstance(event, Objects):
            self.elsewhere = self._elsewhere(event)
        self._updated.set()

    def _elsewhere(self, objects: Objects) -> PersonElsewhere | None:
        for here in objects.objects:
            if self.number in {here.object, *here.aliases}:
                self._numbers = {here.object, *here.aliases}
                if here.visible:
                    return None
        places = (place for place in objects.elsewhere if place.object in self._numbers)
        return next((place for place in places if place.server and place.visible), None)

    def camera_at(self, media_time: float | None) -> str | None:
        """Return the camera shown at ``media_time`` (seconds: pulse / fps); None if unknown."""
        if media_time is None or self.site is None:
            return None
        pulse = round(media_time * self.site.fps)
        place = bisect_right(self._firsts, pulse) - 1
        if place < 0:
            return None
        first = self._firsts[place]
        shown = self._shown[first]
        return shown.camera if pulse < first + shown.frames else None

    async def next_event(self) -> None:
        """Wait for the next event."""
        self._updated.clear()
        await self._updated.wait()

    async def reach(self, media_time: float) -> None:
        """Wait up to a second for the event about ``media_time``, which comes over another connection."""
        if self.site is None:
            return  # no event was received
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_TIMEOUT_S):
                while self.camera_at(media_time) is None:
                    self._updated.clear()
                    await self._updated.wait()

    def stored_frames(self, first: int, last: int) -> Iterator[Frame]:
        """Yield the frames from one pulse to another, both included, in order, as far as the spool has them.

        Raises:
            OSError: the spool cannot be read.
        """
        for begin in self._firsts:
            shown = self._shown[begin]
            outside = begin > last or begin + shown.frames <= first
            if self._spool is None or shown.camera is None or shown.boxes is None or outside:
                continue
            boxes = msgspec.msgpack.decode(self._spool.get(shown.boxes), type=tuple[tuple[Box, ...], ...])
            for pulse, frame_boxes in enumerate(boxes, start=begin):
                if first <= pulse <= last:
                    yield Frame(pulse, shown.camera, frame_boxes)

    def _take_gop(self, gop: Gop) -> None:
        camera = gop.choices.get(self.number)
        boxes = None if camera is None else self._store(gop.boxes.get(camera, ()))
        if gop.first not in self._shown:
            insort(self._firsts, gop.first)
        self._shown[gop.first] = _Shown(gop.frames, camera, boxes)
        if self._spool is None and len(self._firsts) > _MAX_GOPS:
            del self._shown[self._firsts.pop(0)]

    def _store(self, boxes: Sequence[Sequence[Box]]) -> Place | None:
        if self._spool is None:
            return None
        try:
            return self._spool.put(msgspec.msgpack.encode(boxes))
        except OSError as error:  # the recording on the same disk will report it
            _log.debug("boxes are not stored: %s", error)
            return None


@contextlib.asynccontextmanager
async def following(
    url: str,
    history: ViewHistory,
    settings: HttpSettings,
    start: str | None = None,
    end: str | None = None,
    delay: str | None = None,
) -> AsyncIterator[None]:
    """Feed the server's events to ``history`` inside the block; without events the stream still plays.

    With a ``start``, the past events since then are taken first. The block is entered after the first
    event or a second, so that pictures requested inside it have their events.

    Raises:
        ClientError: the past events cannot be fetched.
    """

    async def follow() -> None:
        try:
            async for event in events(url, settings, delay=delay):
                history.take(event)
        except ClientError as error:
            _log.info("no events: %s", error)

    if start is not None:
        history.take(await site(url, settings))
        async for gop in past(url, start, end, settings):
            history.take(gop)
    follower = asyncio.create_task(follow())
    first_event = asyncio.create_task(history.next_event())
    try:
        await asyncio.wait({follower, first_event}, timeout=_TIMEOUT_S, return_when=asyncio.FIRST_COMPLETED)
        yield
    finally:
        follower.cancel()
        first_event.cancel()
        await asyncio.gather(follower, first_event, return_exceptions=True)
