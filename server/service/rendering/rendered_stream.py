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
from server.media.rendering_messages import (
    JpegPicture,
    PictureKind,
    RenderRequest,
    RenderResult,
    RenderSettings,
)
from server.service.rendering.decided_boxes import GopOverlay
from server.service.rendering.mjpeg_streams import MjpegStreams
from server.service.rendering.overlay_video import OverlayVideoPublisher
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import Chunk, Subscriber
from server.system.worker.process import START_S, WorkerDiedError, WorkerProcess

_WORKER = "server.service.rendering.worker"
_ANSWER_S = 5.0
"""A worker that takes longer to answer counts as hung."""


@dataclass(slots=True)
class _StillRequest:
    earliest: int
    done: asyncio.Event
    picture: JpegPicture | None = None


class StillRequests:
    """Pending requests for a still picture, by kind, with the oldest frame that satisfies them."""

    def __init__(self) -> None:
        self._requests: dict[PictureKind, _StillRequest] = {}
        self.changed = asyncio.Event()
        """Set when a request arrives or a new frame may answer one; the reader clears it."""
        self._closed = False

    async def get(self, kind: PictureKind, earliest: int) -> JpegPicture | None:
        """Return a picture of frame ``earliest`` or a newer one, as soon as there is one; None: the end."""
        while not self._closed:
            request = self._requests.get(kind)
            if request is None:
                request = self._requests[kind] = _StillRequest(earliest, asyncio.Event())
            self.changed.set()
            await request.done.wait()
            if request.picture is None or request.picture.pulse >= earliest:
                return request.picture  # an older picture answered an earlier request
        return None

    def answerable(self, newest: int) -> list[PictureKind]:
        """Return the kinds that can be answered when ``newest`` is the newest frame."""
        return [kind for kind, request in self._requests.items() if request.earliest <= newest]

    def answer(self, kind: PictureKind, picture: JpegPicture | None) -> None:
        """Answer all requests of a kind."""
        request = self._requests.pop(kind)
        request.picture = picture
        request.done.set()

    def close(self) -> None:
        """Answer all pending and later requests with None."""
        self._closed = True
        for kind in list(self._requests):
            self.answer(kind, None)


log = logging.getLogger(__name__)

_RETRY_FIRST_S, _RETRY_MAX_S = 0.1, 5.0
_PICTURE_TIMEOUT_S = 8.0
"""How long a request waits for its first picture once a worker is ready, even if that is replaced."""


class PictureTimeoutError(Exception):
    """No picture was rendered in time."""


class RenderedStream:
    """Renders one stream while it has users; its outputs outlive the worker, which may be replaced.

    A slow worker loses whole GOPs, like a slow viewer, and delays nothing else. ``overlay_of`` returns the
    boxes of fragments. ``live`` pictures are shown as they arrive, others in real time. ``audio_buffer`` and
    ``mute_gaps`` are those of :class:`OverlayVideoPublisher`; ``video_kind``: with boxes or not.
    """

    def __init__(
        self,
        name: str,
        find_broadcaster: Callable[[], Broadcaster],
        overlay_of: Callable[[bytes], GopOverlay],
        settings: RenderSettings,
        *,
        live: bool,
        queue_gops: int,
        audio_buffer: AudioBuffer | None = None,
        mute_gaps: bool = False,
        video_kind: PictureKind = "boxed",
    ) -> None:
        self._video_kind: PictureKind = video_kind
        self._name, self._find_broadcaster, self._overlay_of = name, find_broadcaster, overlay_of
        self._settings, self._live, self._queue_gops = settings, live, queue_gops
        self._audio_buffer, self._mute_gaps = audio_buffer, mute_gaps
        self._reset_outputs()
        self._stills = StillRequests()
        self._has_users = asyncio.Event()
        self._has_pictures = asyncio.Event()
        self._is_ready = asyncio.Event()
        """Set while a worker has loaded its libraries."""
        self.newest = -1
        """The last frame that the present worker has rendered."""
        self._has_rendered = False
        self.users = 0
        self.restarts = 0
        self._subscriber: Subscriber | None = None
        self._lost = 0
        self._deaths = LogThrottle()
        self.pid: int | None = None
        """The process id of the present worker."""

    @property
    def viewers(self) -> int:
        """The number of viewers of its video and MJPEG streams."""
        return self.video.broadcaster.viewers + self.mjpeg.viewers

    @property
    def lost(self) -> int:
        """The number of GOPs for which the worker was too slow."""
        return self._lost + (0 if self._subscriber is None else self._subscriber.lost_gops)

    def acquire(self) -> None:
        """Add a user."""
        self.users += 1
        self._has_users.set()

    def release(self) -> None:
        """Remove a user."""
        self.users -= 1
        if not self.users:
            self._has_users.clear()
            self._reset_outputs()

    async def still(self, kind: PictureKind, earliest: int) -> JpegPicture:
        """Return a picture of frame ``earliest`` or a newer one.

        Raises:
            PictureTimeoutError: none was rendered in time.
        """
        with contextlib.suppress(TimeoutError):
            await self._wait_until_ready()
            async with asyncio.timeout(_PICTURE_TIMEOUT_S):
                picture = await self._stills.get(kind, earliest)
                if picture is not None:
                    return picture
        raise PictureTimeoutError

    async def video_head(self) -> bytes:
        """Return the init segment of the video, as soon as there is one.

        Raises:
            PictureTimeoutError: no picture was rendered in time.
        """
        with contextlib.suppress(TimeoutError):
            await self._wait_until_ready()
            await asyncio.wait_for(self.video.head_settled.wait(), _PICTURE_TIMEOUT_S)
        if self.video.head is None:
            raise PictureTimeoutError
        return self.video.head

    async def _wait_until_ready(self) -> None:
        async with asyncio.timeout(START_S):
            await self._is_ready.wait()

    async def run(self) -> None:
        """Render until the stream ends; a worker that dies is replaced."""
        try:
            async with asyncio.TaskGroup() as tasks:
                publishing = tasks.create_task(self._publish_pictures(), name=f"publish {self._name}")
                await self._run_workers()
                publishing.cancel()
        finally:
            self.close()

    async def _run_workers(self) -> None:
        backoff = Backoff(_RETRY_FIRST_S, _RETRY_MAX_S)
        while True:
            try:
                await self._run_worker()
            except WorkerDiedError as error:
                if self._has_rendered:
                    backoff.reset()
                if (more := self._deaths.record(str(error))) is not None:
                    text = "rendering %s: the worker %s%s; starting another"
                    log.warning(text, self._name, error, more)
                self.restarts += 1
                self.video.begin_process()
                await asyncio.sleep(backoff.next())
            else:
                return

    def close(self) -> None:
        """End all outputs for all viewers."""
        self.video.close()
        self.mjpeg.close()
        self._stills.close()
        self._is_ready.set()

    def _reset_outputs(self) -> None:
        """Create new outputs: a later viewer must not receive old content."""
        self.video = OverlayVideoPublisher(
            self._settings, self._queue_gops, self._audio_buffer, mute_gaps=self._mute_gaps
        )
        self.mjpeg = MjpegStreams(self._settings, live=self._live)

    async def _run_worker(self) -> None:
        self.newest, self._has_rendered = -1, False
        worker = await WorkerProcess.start(_WORKER, self._settings, RenderResult, _ANSWER_S)
        self.pid = worker.pid
        jobs = (self._feed(worker), self._answer_stills(worker), self._watch(worker))
        tasks = [asyncio.create_task(job) for job in jobs]
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
                self._is_ready.clear()
                await worker.kill()
                self.pid = None

    async def _watch(self, worker: WorkerProcess[RenderResult]) -> NoReturn:
        """Notify requests when the worker is ready, and wait until it dies."""
        await worker.wait_until_ready()
        self._is_ready.set()
        await worker.wait_until_dead()

    async def _feed(self, worker: WorkerProcess[RenderResult]) -> None:
        """Render the stream's chunks while there are users, until the stream ends."""
        while True:
            await self._has_users.wait()
            broadcaster = self._find_broadcaster()
            subscriber = self._subscriber = broadcaster.subscribe()
            try:
                async for chunk in subscriber.chunks():
                    await self._render(worker, chunk)
                    if not self.users:
                        break
                else:
                    return
            finally:
                broadcaster.unsubscribe(subscriber)
                self._lost, self._subscriber = self.lost, None

    async def _render(self, worker: WorkerProcess[RenderResult], chunk: Chunk) -> None:
        fragments = chunk.data
        overlay = self._overlay_of(fragments)
        result = await worker.ask(
            RenderRequest(
                fragments=fragments,
                first=overlay.first,
                boxes=overlay.boxes,
                chosen=overlay.chosen,
                hidden=overlay.hidden,
                video=self._video_kind if self.video.users else None,
                plain=self.mjpeg.rates(boxed=False),
                boxed=self.mjpeg.rates(boxed=True),
            )
        )
        self.newest, self._has_rendered = result.newest, True
        self.video.put(result.video, is_muted=isinstance(chunk, MediaChunk) and chunk.is_muted)
        self.mjpeg.put(result, asyncio.get_running_loop().time())
        self._has_pictures.set()
        self._stills.changed.set()

    async def _answer_stills(self, worker: WorkerProcess[RenderResult]) -> None:
        while True:
            await self._stills.changed.wait()
            self._stills.changed.clear()
            for kind in self._stills.answerable(self.newest):
                result = await worker.ask(RenderRequest(still=kind))
                self._stills.answer(kind, result.still)

    async def _publish_pictures(self) -> None:
        """Publish MJPEG pictures when they are due."""
        loop = asyncio.get_running_loop()
        while True:
            self._has_pictures.clear()
            next_due = self.mjpeg.publish_due(loop.time())
            timeout = None if next_due is None else max(0.0, next_due - loop.time())
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._has_pictures.wait(), timeout)
