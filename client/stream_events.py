"""Which camera a stream shows and who is where in it, from the events beside it."""

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
from client.model import Box, Event, Gop, Site
from client.spool import Place, Spool

_log = logging.getLogger(__name__)
_GOPS = 64  # remembered where nothing is recorded: far more than the picture is behind the events
_PATIENCE_S = 1.0


@dataclass(frozen=True, slots=True)
class Frame:
    """What is known of one frame of a stream."""

    pulse: int
    camera: str
    boxes: tuple[Box, ...]


@dataclass(frozen=True, slots=True)
class _Shown:
    frames: int
    camera: str | None
    boxes: Place | None
    """Packed: 38 bytes a box and frame. None: they are not known, or not kept."""


class Commentary:
    """Remembers the choices for one object: the last ones, or all of them and the boxes in its pictures.

    ``keep`` is where the boxes are put; None: only the last choices are remembered.
    """

    def __init__(self, number: int, *, keep: Spool | None = None) -> None:
        self.number = number
        self.site: Site | None = None
        self._keep = keep
        self._firsts: list[int] = []
        self._shown: dict[int, _Shown] = {}
        self._heard = asyncio.Event()

    def take(self, event: Event) -> None:
        """Take what an event says about the object."""
        if isinstance(event, Site):
            self.site = event
        elif isinstance(event, Gop):
            self._take_gop(event)
        self._heard.set()

    def camera_at(self, media_time: float | None) -> str | None:
        """Return the camera shown at ``media_time`` (seconds: pulse / fps); None if it is not known."""
        if media_time is None or self.site is None:
            return None
        pulse = round(media_time * self.site.fps)
        place = bisect_right(self._firsts, pulse) - 1
        if place < 0:
            return None
        first = self._firsts[place]
        shown = self._shown[first]
        return shown.camera if pulse < first + shown.frames else None

    async def begin(self) -> None:
        """Wait for the next word."""
        self._heard.clear()
        await self._heard.wait()

    async def reach(self, media_time: float) -> None:
        """Wait a moment for what is said about ``media_time``: it comes by a connection of its own."""
        if self.site is None:
            return  # there are no events
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_PATIENCE_S):
                while self.camera_at(media_time) is None:
                    self._heard.clear()
                    await self._heard.wait()

    def frames(self, first: int, last: int) -> Iterator[Frame]:
        """Yield what is known of the frames from one pulse to another, both included, in order.

        Raises:
            OSError: what was kept cannot be read.
        """
        for begin in self._firsts:
            shown = self._shown[begin]
            outside = begin > last or begin + shown.frames <= first
            if self._keep is None or shown.camera is None or shown.boxes is None or outside:
                continue
            boxes = msgspec.msgpack.decode(self._keep.get(shown.boxes), type=tuple[tuple[Box, ...], ...])
            for pulse, some in enumerate(boxes, start=begin):
                if first <= pulse <= last:
                    yield Frame(pulse, shown.camera, some)

    def _take_gop(self, gop: Gop) -> None:
        camera = gop.choices.get(self.number)
        boxes = None if camera is None else self._kept(gop.boxes.get(camera, ()))
        if gop.first not in self._shown:
            insort(self._firsts, gop.first)
        self._shown[gop.first] = _Shown(gop.frames, camera, boxes)
        if self._keep is None and len(self._firsts) > _GOPS:
            del self._shown[self._firsts.pop(0)]

    def _kept(self, boxes: Sequence[Sequence[Box]]) -> Place | None:
        if self._keep is None:
            return None
        try:
            return self._keep.put(msgspec.msgpack.encode(boxes))
        except OSError as error:  # the disk that the film is on: the recording will say so
            _log.debug("boxes are not kept: %s", error)
            return None


@contextlib.asynccontextmanager
async def following(
    url: str,
    commentary: Commentary,
    settings: HttpSettings,
    start: str | None = None,
    end: str | None = None,
) -> AsyncIterator[None]:
    """Follow the events inside the block; that they cannot be had does not disturb who watches.

    Where there is a ``start``, what was said since then is taken first. The block is entered when the
    server has begun to tell: of pictures that are fetched inside it nothing remains untold.

    Raises:
        ClientError: it cannot be had.
    """

    async def follow() -> None:
        try:
            async for event in events(url, settings):
                commentary.take(event)
        except ClientError as error:
            _log.info("no events: %s", error)

    if start is not None:
        commentary.take(await site(url, settings))
        async for gop in past(url, start, end, settings):
            commentary.take(gop)
    told = asyncio.create_task(follow())
    begun = asyncio.create_task(commentary.begin())
    try:
        await asyncio.wait({told, begun}, timeout=_PATIENCE_S, return_when=asyncio.FIRST_COMPLETED)
        yield
    finally:
        told.cancel()
        begun.cancel()
        await asyncio.gather(told, begun, return_exceptions=True)
