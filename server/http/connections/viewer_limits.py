"""How many may watch: all streams together, and one of them; and how many may be told what happens."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from aiohttp import web

from server.http.access.access_control import ACCESS
from server.http.api.handlers import not_now
from server.http.app_keys import PICTURES, READERS, SERVICE
from server.http.connections.fair_shares import Place, Shares
from server.http.streams.sending import break_off

WATCHING = web.AppKey("watching", Shares)
"""Who watches which stream."""
LISTENING = web.AppKey("listening", Shares)
"""Who is told what happens, or what has happened."""


def no_place(request: web.Request, watching: int = 0, streams: tuple[str, ...] = ()) -> web.Response | None:
    """Say why nobody else may watch a stream that so many watch; None: there is place, or there is now.

    ``streams`` are by what names they hold their places. A process that draws a stream counts as one of its
    viewers, and so does who fetches it (HLS).
    """
    service, shares = request.app[SERVICE], request.app[WATCHING]
    limits = service.config.http
    everybody = service.splicer.viewers + service.past.viewers
    everybody += request.app[PICTURES].viewers + request.app[READERS].all
    if watching - shares.ending(streams) >= limits.viewers_per_object:
        if _makes_room(request, shares, streams):
            return None  # one less of all, too
        return not_now("as many viewers as one stream takes (http.viewers_per_object) are watching")
    if everybody - shares.ending() >= limits.viewers_max and not _makes_room(request, shares):
        return not_now("as many viewers as this server takes (http.viewers_max) are watching")
    return None


@contextmanager
def watching(request: web.Request, stream: str) -> Iterator[Place]:
    """Hold a place among those who watch, inside."""
    with _held(request, request.app[WATCHING], stream) as place:
        yield place


def no_ear(request: web.Request) -> web.Response | None:
    """Say why nobody else may be told what happens; None: there is place, or there is now."""
    shares, most = request.app[LISTENING], request.app[SERVICE].config.http.viewers_max
    if shares.all < most or _makes_room(request, shares):
        return None
    return not_now("as many as this server takes (http.viewers_max) are told what happens")


@contextmanager
def listening(request: web.Request) -> Iterator[None]:
    """Hold a place among those who are told, inside."""
    with _held(request, request.app[LISTENING], ""):
        yield


def _makes_room(request: web.Request, shares: Shares, streams: tuple[str, ...] | None = None) -> bool:
    """Take a place away for who asks, if it is theirs; who asks for a head alone takes no place."""
    return request.method != "HEAD" and shares.make_room(request.app[ACCESS].share_holder(request), streams)


@contextmanager
def _held(request: web.Request, shares: Shares, stream: str) -> Iterator[Place]:
    holder = request.app[ACCESS].share_holder(request)
    place = shares.take(Place(holder, stream, lambda: break_off(request)))
    try:
        yield place
    finally:
        shares.give_up(place)
