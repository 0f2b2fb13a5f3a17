"""How many may watch: all streams together, and one of them."""

from __future__ import annotations

from aiohttp import web

from server.web.api import not_now
from server.web.keys import PICTURES, READERS, SERVICE


def no_place(request: web.Request, watching: int = 0) -> web.Response | None:
    """Say why nobody else may watch a stream that so many watch; None: there is place.

    A process that draws a stream counts as one of its viewers, and so does who fetches it (HLS).
    """
    service = request.app[SERVICE]
    limits = service.config.http
    everybody = service.splicer.viewers + service.past.viewers
    everybody += request.app[PICTURES].viewers + request.app[READERS].all
    if everybody >= limits.viewers_max:
        return not_now("as many viewers as this server takes (http.viewers_max) are watching")
    if watching >= limits.viewers_per_object:
        return not_now("as many viewers as one stream takes (http.viewers_per_object) are watching")
    return None
