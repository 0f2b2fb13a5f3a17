"""Viewer limits: of one stream, of all streams together, and of event streams; names of viewer slots."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from aiohttp import web

from server.http.access.authorization import ACCESS
from server.http.app_keys import SERVICE
from server.http.error_responses import break_off
from server.http.json_responses import unavailable
from server.http.viewers.fair_share import FairShare, Slot
from server.http.viewers.hls_sessions import HLS_SESSIONS
from server.service.facade.rendering import RenderedStream, RenderPoolFullError, Subject

VIEWER_SLOTS = web.AppKey("viewer slots", FairShare)
"""Slots of viewers, by stream."""
EVENT_SLOTS = web.AppKey("event slots", FairShare)
"""Slots of clients that receive events or recorded decisions."""
SEARCH_SLOTS = web.AppKey("search slots", FairShare)
"""Slots of searches of the past, of which one works while the others wait."""
_SEARCHES_MAX = 8
RENDER_SLOTS = web.AppKey("render slots", FairShare)
"""Slots of requests for rendered streams, by what is rendered."""


def evict_or_refuse_viewer(
    request: web.Request, viewers: int = 0, streams: tuple[str, ...] = ()
) -> web.Response | None:
    """Return 503 if no slot is free for another viewer of a stream; None: one is free, or has been evicted.

    ``viewers`` is the number of its viewers; HLS sessions and render workers count as viewers.
    ``streams`` are the names by which its viewers hold slots.
    """
    service, slots = request.app[SERVICE], request.app[VIEWER_SLOTS]
    limits = service.config.http
    total = service.streams.connected_viewers.total + service.recordings.viewers
    total += service.rendering.viewers + request.app[HLS_SESSIONS].all
    if viewers - slots.ending(streams) >= limits.viewers_per_object:
        if _evict(request, slots, streams):
            return None  # that also freed one of the total
        return unavailable("the stream has as many viewers as allowed (http.viewers_per_object)")
    if total - slots.ending() >= limits.viewers_max and not _evict(request, slots):
        return unavailable("the server has as many viewers as allowed (http.viewers_max)")
    return None


@contextmanager
def viewer_slot(request: web.Request, stream: str) -> Iterator[Slot]:
    """Hold a viewer slot inside."""
    with _slot(request, request.app[VIEWER_SLOTS], stream) as slot:
        yield slot


def evict_or_refuse_listener(request: web.Request) -> web.Response | None:
    """Return 503 if no event slot is free; None: one is free, or has been evicted."""
    most = request.app[SERVICE].config.http.viewers_max
    why = "the server has as many event streams as allowed (http.viewers_max)"
    return _evict_or_refuse(request, request.app[EVENT_SLOTS], most, why)


@contextmanager
def event_slot(request: web.Request) -> Iterator[None]:
    """Hold an event slot inside."""
    with _slot(request, request.app[EVENT_SLOTS], ""):
        yield


def evict_or_refuse_search(request: web.Request) -> web.Response | None:
    """Return 503 if too many searches of the past wait; None: another may, or has replaced one."""
    why = "too many searches of the past wait already; try again later"
    return _evict_or_refuse(request, request.app[SEARCH_SLOTS], _SEARCHES_MAX, why)


@contextmanager
def search_slot(request: web.Request) -> Iterator[None]:
    """Hold a search slot inside."""
    with _slot(request, request.app[SEARCH_SLOTS], ""):
        yield


@contextmanager
def rendered_stream(request: web.Request, subject: Subject) -> Iterator[RenderedStream]:
    """Use a rendered stream inside; if all are in use, one of a client with more of them ends for it.

    Raises:
        RenderPoolFullError: all are in use, and no client has more than its fair share.
        KeyError: there is no such person or camera.
    """
    rendering, slots = request.app[SERVICE].rendering, request.app[RENDER_SLOTS]
    client = request.app[ACCESS].client_of(request)

    def end() -> None:
        break_off(request)
        rendering.end(subject)

    with ExitStack() as stack:
        try:
            source = stack.enter_context(rendering.using(subject))
        except RenderPoolFullError:
            if not slots.evict_stream_for(client):
                raise
            source = stack.enter_context(rendering.using(subject))
        slot = slots.take(Slot(client, repr(subject), end))
        stack.callback(slots.release, slot)
        yield source


def _evict_or_refuse(request: web.Request, slots: FairShare, most: int, why: str) -> web.Response | None:
    """Return 503 if ``most`` slots are taken and none can be evicted; None: one is free."""
    return None if slots.all < most or _evict(request, slots) else unavailable(why)


def _evict(request: web.Request, slots: FairShare, streams: tuple[str, ...] | None = None) -> bool:
    """Evict a slot of a client with more than its fair share; HEAD requests need no slot."""
    return request.method != "HEAD" and slots.evict_for(request.app[ACCESS].client_of(request), streams)


@contextmanager
def _slot(request: web.Request, slots: FairShare, stream: str) -> Iterator[Slot]:
    client = request.app[ACCESS].client_of(request)
    slot = slots.take(Slot(client, stream, lambda: break_off(request)))
    try:
        yield slot
    finally:
        slots.release(slot)


def person_slot_name(number: int) -> str:
    """Return the slot name of a person's stream, in HLS and outside."""
    return f"object {number}"


def hls_camera_slot_name(name: str) -> str:
    """Return the slot name of a camera's HLS stream."""
    return f"camera {name}"


def live_camera_slot_name(camera: str) -> str:
    """Return the slot name of a camera's live stream outside HLS."""
    return f"live {camera}"


def fixed_view_slot_name(camera: str) -> str:
    """Return the slot name of a person's stream that always shows one camera, outside HLS."""
    return f"decided {camera}"
