"""The past over HTTP: streams that begin in it, what there is of it, and what was said about it."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator, Callable
from contextlib import aclosing

from aiohttp import web

from server.http.access.access_control import ACCESS, sees_one_person
from server.http.access.scope_filter import told_for
from server.http.api.handlers import answer, no_camera, no_object, not_now, problem
from server.http.api.schema import Past, PastSpan, PastView
from server.http.app_keys import SERVICE
from server.http.connections.viewer_limits import listening, no_ear, no_place, watching
from server.http.hls.sessions import of_live, of_person
from server.http.streams.sending import send_bytes
from server.http.streams.stream_forms import Form
from server.service.recording.media_files import run_in_reader_thread
from server.service.service import BestViewService
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.time_shift.availability import (
    available_camera_ranges,
    available_ranges,
    first_available,
    forget_missing,
    forget_missing_ends,
)
from server.service.time_shift.decision_log import read_decision_lines
from server.service.time_shift.playback import CameraPlayback, PersonPlayback, PlaybackSource, recorded_audio
from server.service.time_shift.playback_audio import PlaybackAudio
from server.service.time_shift.presence_history import PresenceHistory
from server.service.time_shift.time_reference import (
    TimeReferenceError,
    parse_time_reference,
    utc_time_of_pulse,
)
from server.service.time_shift.time_shift_stream import PlaybackRange, TimeShiftStream

routes = web.RouteTableDef()


def asks_for_the_past(request: web.Request) -> bool:
    """Tell whether a stream is to begin in the past."""
    return "from" in request.query or "to" in request.query


async def best_of_the_past(request: web.Request, form: Form) -> web.StreamResponse:
    """Stream the best view of a person from a moment on."""
    service = request.app[SERVICE]
    number = int(request.match_info["object"])
    source = object_past(request, number)
    splicer = service.splicer
    channels = splicer.scoped_persons if sees_one_person(request) else splicer.persons

    def live() -> Broadcaster | None:
        return channels.get(service.board.resolve(number))

    if live() is None:
        if (unread := await unreadable(source, 0)) is not None:
            return unread
        if first_available(source, 0) is None:
            return no_object(service, number)

    def named() -> str:
        return of_person(service.board.resolve(number))

    return await _stream(request, form, source, f"object {number}", live, named)


async def camera_of_the_past(request: web.Request, form: Form) -> web.StreamResponse:
    """Stream one camera from a moment on."""
    service = request.app[SERVICE]
    camera = request.match_info["camera"]
    if camera not in service.frame_buffers:
        return no_camera(service, camera)
    source = CameraPlayback(service.past, camera)

    def live() -> Broadcaster | None:
        return service.splicer.cameras.get(camera)

    return await _stream(request, form, source, f"camera {camera}", live, lambda: of_live(camera))


@routes.get("/api/objects/{object:[0-9]{1,9}}/past")
async def getobject_past(request: web.Request) -> web.Response:
    """Say from when to when a person's best view can be seen again; from= and to= say of which time."""
    number = int(request.match_info["object"])
    source = object_past(request, number)
    if (unread := await unreadable(source, 0)) is not None:
        return unread
    if first_available(source, 0) is None:
        return problem(404, f"nothing is kept of object {number}")
    return await _past(request, source)


@routes.get("/api/cameras/{camera}/past")
async def get_camera_past(request: web.Request) -> web.Response:
    """Say from when to when a camera can be seen again; from= and to= say of which time."""
    service = request.app[SERVICE]
    camera = request.match_info["camera"]
    if camera not in service.frame_buffers:
        return no_camera(service, camera)
    return await _past(request, CameraPlayback(service.past, camera))


@routes.get("/api/past")
async def get_told(request: web.Request) -> web.StreamResponse:
    """Tell again who was where and which camera showed whom, a line for each GOP; from= and to= say when."""
    service = request.app[SERVICE]
    try:
        wish = wish_of(request, service, service.past.recent.end)
    except TimeReferenceError as error:
        return problem(400, str(error))
    end = service.past.recent.end if wish.end is None else wish.end
    sees = request.app[ACCESS].grant(request).sees
    kept = read_decision_lines(service.past, wish.start, end)
    first = await anext(kept, None)
    if first is None and (missing := nothing_said(service, wish)) is not None:
        return missing
    lines = told_for(led_by(first, kept), sees, service.board.resolve)
    full = no_ear(request)
    if full is not None:
        return full
    with listening(request):
        return await send_bytes(request, lines, b"", {"Content-Type": "application/x-ndjson"})


def object_past(request: web.Request, number: int) -> PersonPlayback:
    """Give the past of whoever has a number, or had it, as far as whoever asks may see it."""
    service = request.app[SERVICE]
    now = service.board.resolve(number)
    numbers = (number,) if number == now else (now, number)
    if not sees_one_person(request):
        return PersonPlayback(service.past, numbers)
    fps, unseen_s = service.config.site.fps, service.config.access.unseen_s
    return PersonPlayback(
        service.past, numbers, PresenceHistory(service.past, numbers, round(unseen_s * fps), fps)
    )


def wish_of(
    request: web.Request,
    service: BestViewService,
    now: int,
    *,
    start: int | None = None,
    endless: str | None = None,
) -> PlaybackRange:
    """Read from= and to=; ``now`` is the pulse that seconds back are counted from.

    ``start`` is from when on where from= is left out; None: it must not be. ``endless`` is a word that to=
    may be, and means no end.

    Raises:
        MomentError: they are no moments, or the second is not after the first.
    """
    fps, pulse0 = service.config.site.fps, service.pulse0
    moments: dict[str, int] = {}
    for name in ("from", "to"):
        if name in request.query and (name, request.query[name]) != ("to", endless):
            try:
                moments[name] = parse_time_reference(request.query[name], now=now, fps=fps, pulse0=pulse0)
            except TimeReferenceError as error:
                raise TimeReferenceError(f"{name}: {error}") from error
    start, end = moments.get("from", start), moments.get("to")
    if start is None:
        raise TimeReferenceError("from: is missing; it says from when on, such as ?from=-60")
    if end is not None and end <= start:
        raise TimeReferenceError(f"to: p{end} is not after from, which is p{start}")
    return PlaybackRange(start, end)


async def unreadable(source: PlaybackSource, start: int, end: int | None = None) -> web.Response | None:
    """Forget what has gone from the disk where a time begins and ends; say so where nobody can tell."""
    try:
        await run_in_reader_thread(forget_missing_ends, source, start, end)
    except OSError as error:
        return _unread(error)
    return None


async def nothing_kept(source: PlaybackSource, wish: PlaybackRange, what: str) -> web.Response | None:
    """Say that nothing is kept of the time that somebody wants to see, and what is; None: something is."""
    if (unread := await unreadable(source, wish.start, wish.end)) is not None:
        return unread
    first = first_available(source, wish.start)
    if first is not None and (wish.end is None or first < wish.end):
        return None
    try:
        await run_in_reader_thread(forget_missing, source, 0, sys.maxsize)
    except OSError as error:
        return _unread(error)
    there = available_ranges(source)
    kept = ", ".join(f"p{it.first} to p{it.end - 1}" for it in there) or "nothing"
    return problem(416, f"of {what} nothing is kept from p{wish.start} on; there is {kept}")


def nothing_said(service: BestViewService, wish: PlaybackRange) -> web.Response | None:
    """Say that of a time nothing is kept that was said about it; None: nothing has been said yet."""
    if wish.start >= service.past.recent.end:
        return None
    end = "on" if wish.end is None else f"to p{wish.end - 1}"
    return problem(416, f"nothing is kept of what was said from p{wish.start} {end}")


async def led_by(first: bytes | None, lines: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    """Give a line, where there is one, and then others."""
    if first is not None:
        yield first
    async for line in lines:
        yield line


def _unread(error: OSError) -> web.Response:
    return not_now(f"what is recorded cannot be read: {error.strerror or error}")


def new_timeline(service: BestViewService) -> GaplessTimeline:
    """Give the time of one viewer's stream."""
    return GaplessTimeline(service.agreement, service.config.site.fps, service.config.encode.gop)


async def _stream(
    request: web.Request,
    form: Form,
    source: PlaybackSource,
    what: str,
    live: Callable[[], Broadcaster | None],
    named: Callable[[], str],
) -> web.StreamResponse:
    """Stream from a moment on; ``live`` is what the stream goes on with, by that name then."""
    service, past = request.app[SERVICE], request.app[SERVICE].past
    head, fps = form.head(service), service.config.site.fps
    if head is None:
        return not_now("no camera has delivered a picture yet")
    if request.query.get("overlay", "0") != "0":
        return problem(400, "overlay: boxes are not burnt into the past; /api/past tells where they are")
    try:
        wish = wish_of(request, service, source.end)
    except TimeReferenceError as error:
        return problem(400, str(error))
    missing = await nothing_kept(source, wish, what)
    if missing is not None:
        return missing
    full = no_place(request)
    if full is not None:
        return full
    counted = 1

    def joined() -> Broadcaster | None:
        nonlocal counted
        past.viewers -= counted
        counted = 0  # from now on the channel counts
        place.stream = named()
        return live()

    sound = past.sound
    hearing = (
        None if sound is None else PlaybackAudio(sound, lambda: recorded_audio(past), lambda: source.end)
    )
    stream = TimeShiftStream(source, new_timeline(service), fps, joined, hearing)
    with watching(request, "past") as place:
        past.viewers += 1
        try:
            async with aclosing(stream.send(wish)) as pieces:
                data = (form.packed(piece) async for piece in pieces)
                return await send_bytes(request, data, head, {"Content-Type": form.content_type})
        finally:
            past.viewers -= counted


async def _past(request: web.Request, source: PlaybackSource) -> web.Response:
    service = request.app[SERVICE]
    fps, pulse0 = service.config.site.fps, service.pulse0
    try:
        wish = wish_of(request, service, source.end, start=0)
    except TimeReferenceError as error:
        return problem(400, str(error))
    end = sys.maxsize if wish.end is None else wish.end
    try:
        await run_in_reader_thread(forget_missing, source, wish.start, end)
    except OSError as error:
        return _unread(error)
    spans = [
        PastSpan(
            it.first,
            it.end - it.first,
            utc_time_of_pulse(it.first, fps, pulse0),
            utc_time_of_pulse(it.end, fps, pulse0),
        )
        for it in available_ranges(source, wish.start, end)
    ]
    views = [
        PastView(it.camera, it.first, it.end - it.first)
        for it in available_camera_ranges(source, wish.start, end)
    ]
    return answer(Past(spans, views))
