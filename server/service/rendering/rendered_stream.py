"""One rendered stream: subscribes to a spliced stream and has a worker process decode and draw it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

from expbackoff import Backoff
from logthrottle import LogThrottle
from server.media.rendering_messages import Canvas, JpegPicture, RenderRequest, Still
from server.service.rendering.decided_boxes import GopOverlay
from server.service.rendering.mjpeg_streams import MjpegStreams
from server.service.rendering.overlay_video import OverlayVideo
from server.service.rendering.worker_process import START_S, RenderWorker, WorkerDiedError
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import Chunk, Subscriber


@dataclass(slots=True)
class _StillRequest:
    pulse: int
    given: asyncio.Event
    picture: JpegPicture | None = None


class StillRequests:
    """Who waits for a picture with boxes or without, and from which frame on it is new enough."""

    def __init__(self) -> None:
        self._wishes: dict[Still, _StillRequest] = {}
        self.asked = asyncio.Event()
        """A request came since it was cleared."""
        self._closed = False

    async def get(self, kind: Still, pulse: int) -> JpegPicture | None:
        """Wait for a picture of this frame or a newer one; None: there will be none."""
        while not self._closed:
            wish = self._wishes.get(kind)
            if wish is None:
                wish = self._wishes[kind] = _StillRequest(pulse, asyncio.Event())
            self.asked.set()
            await wish.given.wait()
            if wish.picture is None or wish.picture.pulse >= pulse:
                return wish.picture  # an older picture answered an earlier request
        return None

    def possible(self, newest: int) -> list[Still]:
        """Return the kinds that can be answered when ``newest`` is the newest frame."""
        return [kind for kind, wish in self._wishes.items() if wish.pulse <= newest]

    def give(self, kind: Still, picture: JpegPicture | None) -> None:
        """Answer all requests of a kind."""
        wish = self._wishes.pop(kind)
        wish.picture = picture
        wish.given.set()

    def close(self) -> None:
        """Answer all requests, and those to come: there will be no picture."""
        self._closed = True
        for kind in list(self._wishes):
            self.give(kind, None)


log = logging.getLogger(__name__)

_RETRY_FIRST_S, _RETRY_MAX_S = 0.1, 5.0
_PATIENCE_S = 8.0
"""How long a request waits for its first picture once a process is ready, which may be replaced meanwhile."""


class PictureTimeoutError(Exception):
    """No picture came in time."""


class RenderedStream:
    """Decodes one stream while somebody uses it; what is made of it outlives the process that makes it.

    A slow process is a slow viewer: it loses whole GOPs, and nobody waits for it. ``told`` gives the boxes of
    fragments. ``live`` pictures are shown as they come, others in pace. ``sound`` goes under the film, with
    ``silent_holes`` only where there are pictures.
    """

    def __init__(
        self,
        name: str,
        stream: Broadcaster,
        told: Callable[[bytes], GopOverlay],
        canvas: Canvas,
        *,
        live: bool,
        queue_gops: int,
        sound: AudioBuffer | None = None,
        silent_holes: bool = False,
    ) -> None:
        self._name, self._stream, self._told, self._canvas = name, stream, told, canvas
        self._live, self._queue_gops, self._sound = live, queue_gops, sound
        self._silent_holes = silent_holes
        self._begin()
        self._stills = StillRequests()
        self._used = asyncio.Event()
        self._shown = asyncio.Event()
        self._ready = asyncio.Event()
        """Set while a process has loaded its libraries."""
        self.newest = -1
        """The last frame that the present process has drawn."""
        self._answered = False
        self.users = 0
        self.restarts = 0
        self._viewer: Subscriber | None = None
        self._lost = 0
        self._dies = LogThrottle()
        self.pid: int | None = None
        """The process that draws now."""

    @property
    def viewers(self) -> int:
        """How many streams of it are being watched."""
        return self.film.channel.viewers + self.series.viewers

    @property
    def lost(self) -> int:
        """How many GOPs the process was too slow for."""
        return self._lost + (0 if self._viewer is None else self._viewer.lost_gops)

    def use(self) -> None:
        """Somebody uses it."""
        self.users += 1
        self._used.set()

    def release(self) -> None:
        """Somebody does not use it any more."""
        self.users -= 1
        if not self.users:
            self._used.clear()
            self._begin()

    async def still(self, kind: Still, pulse: int) -> JpegPicture:
        """Return a picture of this frame or a newer one.

        Raises:
            PictureTimeoutError: none came in time.
        """
        with contextlib.suppress(TimeoutError):
            await self._wait_until_ready()
            async with asyncio.timeout(_PATIENCE_S):
                picture = await self._stills.get(kind, pulse)
                if picture is not None:
                    return picture
        raise PictureTimeoutError

    async def film_head(self) -> bytes:
        """Return the init segment of the overlay video, as soon as there is one.

        Raises:
            PictureTimeoutError: none came in time.
        """
        with contextlib.suppress(TimeoutError):
            await self._wait_until_ready()
            await asyncio.wait_for(self.film.begun.wait(), _PATIENCE_S)
        if self.film.head is None:
            raise PictureTimeoutError
        return self.film.head

    async def _wait_until_ready(self) -> None:
        async with asyncio.timeout(START_S):
            await self._ready.wait()

    async def run(self) -> None:
        """Draw until the stream ends; a process that dies is replaced."""
        try:
            async with asyncio.TaskGroup() as both:
                show = both.create_task(self._show(), name=f"show {self._name}")
                await self._draw_on()
                show.cancel()
        finally:
            self.close()

    async def _draw_on(self) -> None:
        backoff = Backoff(_RETRY_FIRST_S, _RETRY_MAX_S)
        while True:
            try:
                await self._run_process()
            except WorkerDiedError as error:
                if self._answered:
                    backoff.reset()
                if (more := self._dies.record(str(error))) is not None:
                    told = "drawing %s: the process %s%s; starting another"
                    log.warning(told, self._name, error, more)
                self.restarts += 1
                self.film.interrupted()
                await asyncio.sleep(backoff.next())
            else:
                return

    def close(self) -> None:
        """End what is made of it for everybody."""
        self.film.close()
        self.series.close()
        self._stills.close()
        self._ready.set()

    def _begin(self) -> None:
        """Begin anew what is made of it: whoever comes must not be shown what others saw before."""
        self.film = OverlayVideo(self._canvas, self._queue_gops, self._sound, silent_holes=self._silent_holes)
        self.series = MjpegStreams(self._canvas, live=self._live)

    async def _run_process(self) -> None:
        self.newest, self._answered = -1, False
        process = await RenderWorker.start(self._canvas)
        self.pid = process.pid
        works = (self._feed(process), self._give_stills(process), self._watch(process))
        tasks = [asyncio.create_task(work) for work in works]
        try:
            finished, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in finished:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
            try:
                await asyncio.gather(*tasks, return_exceptions=True)
            finally:
                self._ready.clear()
                await process.end()
                self.pid = None

    async def _watch(self, process: RenderWorker) -> NoReturn:
        """Let requests know when the process is ready, and wait until it dies."""
        await process.wait_until_ready()
        self._ready.set()
        await process.watch()

    async def _feed(self, process: RenderWorker) -> None:
        """Draw the stream's chunks while the stream has users, until it ends."""
        while True:
            await self._used.wait()
            viewer = self._viewer = self._stream.subscribe()
            try:
                async for piece in viewer.chunks():
                    await self._draw(process, piece)
                    if not self.users:
                        break
                else:
                    return
            finally:
                self._stream.unsubscribe(viewer)
                self._lost, self._viewer = self.lost, None

    async def _draw(self, process: RenderWorker, piece: Chunk) -> None:
        fragments = piece.data
        told = self._told(fragments)
        drawn = await process.ask(
            RenderRequest(
                fragments=fragments,
                first=told.first,
                boxes=told.boxes,
                chosen=told.chosen,
                film=self.film.wanted > 0,
                plain=self.series.rates(boxed=False),
                boxed=self.series.rates(boxed=True),
            )
        )
        self.newest, self._answered = drawn.newest, True
        self.film.put(drawn.film, silent=isinstance(piece, MediaChunk) and piece.is_muted)
        self.series.put(drawn, asyncio.get_running_loop().time())
        self._shown.set()
        self._stills.asked.set()

    async def _give_stills(self, process: RenderWorker) -> None:
        while True:
            await self._stills.asked.wait()
            self._stills.asked.clear()
            for kind in self._stills.possible(self.newest):
                drawn = await process.ask(RenderRequest(still=kind))
                self._stills.give(kind, drawn.still)

    async def _show(self) -> None:
        """Pass pictures on, each at its moment."""
        loop = asyncio.get_running_loop()
        while True:
            self._shown.clear()
            following = self.series.show(loop.time())
            timeout = None if following is None else max(0.0, following - loop.time())
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._shown.wait(), timeout)
