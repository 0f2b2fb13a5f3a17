"""The pool of render processes: one rendered stream per person or camera that is watched as pictures."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from logthrottle import LogThrottle
from server.media.rendering_messages import Canvas
from server.service.pipeline import BestViewPipeline
from server.service.rendering.decided_boxes import NO_OVERLAY, DecidedBoxes, GopOverlay
from server.service.rendering.rendered_stream import RenderedStream

log = logging.getLogger(__name__)

_LINGER_S = 5.0
"""How long a process is kept after its last use, for who comes back or asks for one still after another."""
_BESIDE = 2
"""Decisions kept besides those whose frames can still wait for a drawing process."""


class RenderPoolFullError(Exception):
    """As many pictures as this server makes are being made."""


@dataclass(frozen=True, slots=True)
class PersonView:
    """The best view of somebody; or, scoped, what of it somebody is shown who may see nobody else."""

    number: int
    scoped: bool = False

    def __str__(self) -> str:
        return f"object {self.number}{' alone' * self.scoped}"


@dataclass(frozen=True, slots=True)
class CameraView:
    """A camera, live; or, decided, with everybody's boxes and as late as a best view."""

    camera: str
    decided: bool = False

    def __str__(self) -> str:
        return f"camera {self.camera}"


Subject = PersonView | CameraView


@dataclass(slots=True)
class _RunningStream:
    source: RenderedStream
    task: asyncio.Task[None]
    expiry: asyncio.TimerHandle | None = None


class RenderPool:
    """Starts what is wanted and lets it end when nobody wants it; at most ``http.pictures_max`` at once."""

    def __init__(self, service: BestViewPipeline, linger_s: float = _LINGER_S) -> None:
        self._service, self._linger_s = service, linger_s
        config = service.config
        self._queue = config.http.viewer_queue_gops
        self._most = config.http.pictures_max
        self._canvas = Canvas(
            codec=config.encode.codec,
            width=config.site.width,
            height=config.site.height,
            fps=config.site.fps,
            gop=config.encode.gop,
            preset=config.encode.preset,
            crf=config.encode.crf,
            max_kbps=config.encode.max_kbps,
            jpeg_quality=config.http.jpeg_quality,
        )
        self._decided = DecidedBoxes(service.decision_state.resolve, config.site.fps, self._queue + _BESIDE)
        service.on_decision.append(self._decided.put)
        self._running: dict[Subject, _RunningStream] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        """Those of sources that are running, or ending."""
        self._restarts = self._lost = 0
        self._failing = LogThrottle()

    @property
    def sources(self) -> dict[Subject, RenderedStream]:
        """What is drawn now."""
        return {subject: running.source for subject, running in self._running.items()}

    @property
    def viewers(self) -> int:
        """How many streams of pictures are being watched."""
        return sum(source.viewers for source in self.sources.values())

    @property
    def restarts(self) -> int:
        """How many processes died and were replaced."""
        return self._restarts + sum(source.restarts for source in self.sources.values())

    @property
    def lost(self) -> int:
        """How many GOPs were not drawn because a process was too slow."""
        return self._lost + sum(source.lost for source in self.sources.values())

    @contextmanager
    def using(self, subject: Subject) -> Iterator[RenderedStream]:
        """Use a source while inside; the subject must be there.

        Raises:
            RenderPoolFullError: there is none, and no place for another.
            KeyError: nobody has this number, or no camera this name.
        """
        running = self._running.get(subject)
        if running is None:
            running = self._start(subject)
        if running.expiry is not None:
            running.expiry.cancel()
        running.source.use()
        try:
            yield running.source
        finally:
            running.source.release()
            if not running.source.users:
                loop = asyncio.get_running_loop()
                running.expiry = loop.call_later(self._linger_s, self._end, subject, running)

    def newest(self, subject: Subject) -> int | None:
        """Return the newest frame of a subject; None: it cannot be shown now.

        Raises:
            KeyError: nobody has this number, or no camera this name.
        """
        service = self._service
        if isinstance(subject, PersonView):
            standing = service.decision_state.selected_views[subject.number]
            return None if standing.choice.camera is None else standing.first + standing.frames - 1
        if service.ingest.states[subject.camera].label not in {"live", "ended"}:
            return None
        if subject.decided:
            return self._decided.newest
        return service.frame_buffers[subject.camera].newest

    async def close(self) -> None:
        """End all sources and their processes."""
        tasks = list(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _start(self, subject: Subject) -> _RunningStream:
        if len(self._running) >= self._most:
            self._make_place()
        source = self._source(subject)
        task = asyncio.create_task(source.run(), name=f"draw {subject}")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        running = self._running[subject] = _RunningStream(source, task)
        task.add_done_callback(lambda _: self._ended(subject, running))
        return running

    def _make_place(self) -> None:
        """End one that nobody uses."""
        for subject, running in self._running.items():
            if not running.source.users:
                self._end(subject, running)
                return
        raise RenderPoolFullError

    def _source(self, subject: Subject) -> RenderedStream:
        splicer, decided = self._service.splicer, self._decided
        told: Callable[[bytes], GopOverlay]
        match subject:
            case PersonView(number, scoped):
                stream = (splicer.scoped_persons if scoped else splicer.persons)[number]
                told = partial(decided.of_person, number, alone=scoped)
            case CameraView(camera, decided=True):
                stream, told = splicer.decided_cameras[camera], partial(decided.of_camera, camera)
            case CameraView(camera):
                stream, told = splicer.cameras[camera], _nothing
        live = isinstance(subject, CameraView) and not subject.decided
        return RenderedStream(
            str(subject),
            stream,
            told,
            self._canvas,
            live=live,
            queue_gops=self._queue,
            sound=self._service.audio_buffer,
            silent_holes=isinstance(subject, PersonView) and subject.scoped,  # what was there is not known
        )

    def _end(self, subject: Subject, running: _RunningStream) -> None:
        running.task.cancel()
        self._forget(subject, running)

    def _ended(self, subject: Subject, running: _RunningStream) -> None:
        error = None if running.task.cancelled() else running.task.exception()
        if error is not None and (more := self._failing.record(repr(error))) is not None:
            log.error("drawing %s failed%s", subject, more, exc_info=error)
        self._forget(subject, running)

    def _forget(self, subject: Subject, running: _RunningStream) -> None:
        """Let go of one that is ending; another of the same subject may have begun since."""
        if self._running.get(subject) is not running:
            return
        del self._running[subject]
        self._restarts += running.source.restarts
        self._lost += running.source.lost


def _nothing(fragments: bytes) -> GopOverlay:
    """Frames that are not decided yet have no boxes."""
    del fragments
    return NO_OVERLAY
