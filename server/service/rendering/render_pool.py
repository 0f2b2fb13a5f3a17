"""The pool of rendered streams: one worker process per person or camera that is watched as pictures."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from logthrottle import LogThrottle
from server.config.sections.access import Blur
from server.media.rendering_messages import PictureKind, RenderSettings
from server.messaging.messages import GopChoices
from server.service.pipeline import BestViewPipeline
from server.service.rendering.decided_boxes import NO_OVERLAY, DecidedBoxes, GopOverlay, hide_people
from server.service.rendering.rendered_stream import RenderedStream
from server.service.streaming.broadcaster import Broadcaster
from server.service.view_selection.delay_modes import DelayMode

log = logging.getLogger(__name__)

_LINGER_S = 5.0
"""Seconds that an unused worker is kept: a client may return, or poll for stills."""
_EXTRA_DECISIONS = 2
"""Decisions kept in addition to those whose frames can be queued for a worker."""


class RenderPoolFullError(Exception):
    """All rendered streams that ``http.pictures_max`` permits are in use."""


@dataclass(frozen=True, slots=True)
class PersonView:
    """A person's best view; ``scoped_to_person``: for viewers with access to that person alone.

    ``blur``: whom its viewers see pixelated; ``video``: whether boxes are burnt into its video; ``prefer``:
    the camera that is shown while it sees the person.
    """

    number: int
    scoped_to_person: bool = False
    delay: DelayMode = DelayMode.BALANCED
    blur: Blur | None = None
    video: PictureKind = "boxed"
    prefer: str | None = None

    def __str__(self) -> str:
        name = f"object {self.number}{' scoped' * self.scoped_to_person}"
        name += "" if self.delay is DelayMode.BALANCED else f" {self.delay}"
        name += "" if self.prefer is None else f" preferring {self.prefer}"
        return name + _blur_text(self.blur)


@dataclass(frozen=True, slots=True)
class CameraView:
    """A camera's live stream; ``decided``: with all boxes, and as late as a best view.

    ``blur``: everybody is pixelated, whatever it is; only where ``decided``. ``video``: as of a person.
    """

    camera: str
    decided: bool = False
    blur: Blur | None = None
    video: PictureKind = "boxed"

    def __str__(self) -> str:
        return f"camera {self.camera}{_blur_text(self.blur)}"


def _blur_text(blur: Blur | None) -> str:
    return "" if blur is None else f" with {blur} blurred"


Subject = PersonView | CameraView


@dataclass(slots=True)
class _RunningStream:
    stream: RenderedStream
    task: asyncio.Task[None]
    expiry: asyncio.TimerHandle | None = None


class RenderPool:
    """Starts rendered streams on demand and ends unused ones; at most ``http.pictures_max`` run at once."""

    def __init__(self, pipeline: BestViewPipeline, linger_s: float = _LINGER_S) -> None:
        self._pipeline, self._linger_s = pipeline, linger_s
        config = pipeline.config
        self._queue_gops = config.http.viewer_queue_gops
        self._max_streams = config.http.pictures_max
        self._settings = RenderSettings(
            input_codec=config.encode.codec,
            width=config.site.width,
            height=config.site.height,
            fps=config.site.fps,
            gop=config.gop,
            preset=config.encode.preset,
            crf=config.encode.crf,
            max_kbps=config.encode.max_kbps,
            jpeg_quality=config.http.jpeg_quality,
        )
        decisions = self._queue_gops + _EXTRA_DECISIONS
        self._decided = DecidedBoxes(pipeline.decision_state.resolve, config.site.fps, decisions)
        pipeline.on_decision.append(self._decided.put)
        self._smooth = DecidedBoxes(pipeline.decision_state.resolve, config.site.fps, decisions)
        pipeline.mode_publisher.on_decision.append(self._put_mode)
        self._running: dict[Subject, _RunningStream] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        """The tasks of streams that are running or ending."""
        self._restarts = self._lost = 0
        self._failing = LogThrottle()

    @property
    def streams(self) -> dict[Subject, RenderedStream]:
        """The running streams."""
        return {subject: running.stream for subject, running in self._running.items()}

    @property
    def viewers(self) -> int:
        """The number of viewers of all rendered streams."""
        return sum(stream.viewers for stream in self.streams.values())

    @property
    def restarts(self) -> int:
        """The number of workers that died and were replaced."""
        return self._restarts + sum(stream.restarts for stream in self.streams.values())

    @property
    def lost(self) -> int:
        """The number of GOPs that were not rendered because a worker was too slow."""
        return self._lost + sum(stream.lost for stream in self.streams.values())

    @contextmanager
    def using(self, subject: Subject) -> Iterator[RenderedStream]:
        """Return the rendered stream of a subject, started if it does not run; it stays while inside.

        Raises:
            RenderPoolFullError: it does not run, and all permitted streams are in use.
            KeyError: there is no such person or camera.
        """
        running = self._running.get(subject)
        if running is None:
            running = self._start(subject)
        if running.expiry is not None:
            running.expiry.cancel()
        running.stream.acquire()
        try:
            yield running.stream
        finally:
            running.stream.release()
            if not running.stream.users:
                loop = asyncio.get_running_loop()
                running.expiry = loop.call_later(self._linger_s, self._end, subject, running)

    def newest(self, subject: Subject) -> int | None:
        """Return the newest frame of a subject; None: it cannot be shown now.

        Raises:
            KeyError: there is no such person or camera.
        """
        pipeline = self._pipeline
        if isinstance(subject, PersonView):
            view = pipeline.decision_state.selected_views[subject.number]
            newest = {
                DelayMode.LIVE: max(buffer.newest for buffer in pipeline.frame_buffers.values()),
                DelayMode.BALANCED: view.first + view.frames - 1,
                DelayMode.SMOOTH: self._smooth.newest,
            }
            return None if view.choice.camera is None else newest[subject.delay]
        if pipeline.ingest.states[subject.camera].label not in {"live", "ended"}:
            return None
        if subject.decided:
            return self._decided.newest
        return pipeline.frame_buffers[subject.camera].newest

    def end(self, subject: Subject) -> None:
        """End a stream, whether or not it has users."""
        running = self._running.get(subject)
        if running is not None:
            self._end(subject, running)

    async def close(self) -> None:
        """End all streams and their workers."""
        # Those that are ending already are only waited for: cancelled again, they would leave their workers.
        for subject, running in list(self._running.items()):
            self._end(subject, running)
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _start(self, subject: Subject) -> _RunningStream:
        if len(self._running) >= self._max_streams:
            self._end_unused()
        stream = self._new_stream(subject)
        task = asyncio.create_task(stream.run(), name=f"render {subject}")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        running = self._running[subject] = _RunningStream(stream, task)
        task.add_done_callback(lambda _: self._ended(subject, running))
        return running

    def _end_unused(self) -> None:
        """End a stream without users.

        Raises:
            RenderPoolFullError: all have users.
        """
        for subject, running in self._running.items():
            if not running.stream.users:
                self._end(subject, running)
                return
        raise RenderPoolFullError

    def _new_stream(self, subject: Subject) -> RenderedStream:
        splicer, decided = self._pipeline.splicer, self._decided
        overlay_of: Callable[[bytes], GopOverlay]
        find: Callable[[], Broadcaster]
        # Streams of a preferred camera and without delay end with their last viewer.
        match subject:
            case PersonView(number, scoped_to_person, prefer=str(camera)):
                preferring = splicer.preferred_scoped if scoped_to_person else splicer.preferred
                find, overlay_of = partial(preferring.broadcaster, number, camera), _no_overlay
            case PersonView(number, delay=DelayMode.LIVE):
                find, overlay_of = partial(splicer.live_persons.broadcaster, number), _no_overlay
            case PersonView(number, scoped_to_person, DelayMode.SMOOTH):
                find = _always(splicer.smooth_person(number, scoped_to_person=scoped_to_person))
                overlay_of = partial(
                    self._smooth.overlay_of_person, number, scoped_to_person=scoped_to_person
                )
            case PersonView(number, scoped_to_person):
                find = _always((splicer.scoped_persons if scoped_to_person else splicer.persons)[number])
                overlay_of = partial(decided.overlay_of_person, number, scoped_to_person=scoped_to_person)
            case CameraView(camera, decided=True):
                find = _always(splicer.decided_cameras[camera])
                overlay_of = partial(decided.overlay_of_camera, camera)
            case CameraView(camera):
                find, overlay_of = _always(splicer.cameras[camera]), _no_overlay
        if subject.blur is not None:
            shown = subject.number if isinstance(subject, PersonView) and subject.blur == "others" else None
            overlay_of = partial(self._hiding, overlay_of, shown)
        live = subject.delay is DelayMode.LIVE if isinstance(subject, PersonView) else not subject.decided
        return RenderedStream(
            str(subject),
            find,
            overlay_of,
            self._settings,
            live=live,
            queue_gops=self._queue_gops,
            # People are recognized by their voices, too.
            audio_buffer=None if subject.blur is not None else self._pipeline.audio_buffer,
            video_kind=subject.video,
            # The person may not have been present in a gap.
            mute_gaps=isinstance(subject, PersonView) and subject.scoped_to_person,
        )

    def _hiding(
        self, overlay_of: Callable[[bytes], GopOverlay], shown: int | None, fragments: bytes
    ) -> GopOverlay:
        """Return a GOP's overlay that hides everybody but one person; None: everybody."""
        overlay, state = overlay_of(fragments), self._pipeline.decision_state
        regions = [] if overlay.camera is None else state.occupied(overlay.camera, overlay.first)
        return hide_people(overlay, regions, shown, state.resolve)

    def _put_mode(self, mode: DelayMode, choices: GopChoices) -> None:
        if mode is DelayMode.SMOOTH:
            self._smooth.put(choices)

    def _end(self, subject: Subject, running: _RunningStream) -> None:
        running.task.cancel()
        self._forget(subject, running)

    def _ended(self, subject: Subject, running: _RunningStream) -> None:
        error = None if running.task.cancelled() else running.task.exception()
        if error is not None and (more := self._failing.record(repr(error))) is not None:
            log.error("rendering %s failed%s", subject, more, exc_info=error)
        self._forget(subject, running)

    def _forget(self, subject: Subject, running: _RunningStream) -> None:
        """Remove a stream that is ending, unless its subject has a new one already."""
        if self._running.get(subject) is not running:
            return
        del self._running[subject]
        self._restarts += running.stream.restarts
        self._lost += running.stream.lost


def _always(broadcaster: Broadcaster) -> Callable[[], Broadcaster]:
    """Return what finds a stream that is there as long as its subject is."""
    return lambda: broadcaster


def _no_overlay(fragments: bytes) -> GopOverlay:
    """Return no boxes: live frames are not decided yet."""
    del fragments
    return NO_OVERLAY
