"""``/api/past/search``: who stayed where in the recorded past, and when."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from aiohttp import web

from server.http.access.authorization import ACCESS
from server.http.access.permissions import Scope
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response, json_response
from server.http.streams.time_range import parse_time_range
from server.http.viewers.viewer_limits import evict_or_refuse_search, search_slot
from server.service.facade.errors import InvalidCommandError
from server.service.facade.past_search import ALL, PastQuery
from server.service.facade.recordings import TimeReferenceError

routes = web.RouteTableDef()

_LONGEST_DAYS = 31
_DAY_S = 86_400
_LIMIT_MAX = 1000
_ORDERS = ("time", "newest", "longest")
_NUMBER = re.compile(r"[0-9]{1,9}")
_SECONDS = re.compile(r"[0-9]{1,5}(\.[0-9]{1,9})?")
_DEFAULT = PastQuery(0, 0)

PAST_SEARCH_QUERIES: dict[str, dict[str, Any]] = {
    "zone": {"type": "string", "description": f"Stays in this area, as it is today; {ALL}: in each."},
    "camera": {"type": "string", "description": f"Stays in this camera's picture; {ALL}: in each."},
    "object": {"type": "integer", "minimum": 0, "maximum": 999_999_999, "description": "Only this person."},
    "min_s": {
        "type": "number",
        "minimum": 0,
        "maximum": _DAY_S,
        "default": _DEFAULT.min_s,
        "description": "Seconds of a stay, at least.",
    },
    "gap_s": {
        "type": "number",
        "minimum": 0,
        "maximum": _DAY_S,
        "default": _DEFAULT.gap_s,
        "description": "Seconds of absence within one stay, at most.",
    },
    "order": {"enum": list(_ORDERS), "default": _DEFAULT.order, "description": "Order of the stays."},
    "limit": {
        "type": "integer",
        "minimum": 1,
        "maximum": _LIMIT_MAX,
        "default": _DEFAULT.limit,
        "description": "Stays, and people, at most.",
    },
}
"""The parameters besides from= and to=, and their schemas."""


@routes.get("/api/past/search")
async def search_past(request: web.Request) -> web.Response:
    """Search recorded decisions for people's stays: in zones, in cameras' pictures, or anywhere."""
    service, scope = request.app[SERVICE], request.app[ACCESS].grant(request).scope
    try:
        query = _parse_query(request, scope)
    except (TimeReferenceError, InvalidCommandError) as error:
        return error_response(400, str(error))
    refused = _refuse_outside(query, scope, service.people.current_number) or evict_or_refuse_search(request)
    if refused is not None:
        return refused
    with search_slot(request):
        return json_response(await service.past_search.search(query))


def _refuse_outside(query: PastQuery, scope: Scope, resolve: Callable[[int], int]) -> web.Response | None:
    """Return 403 for a query beyond a token's scope."""
    if scope.object is not None and resolve(query.person or 0) != resolve(scope.object):
        return error_response(403, f"object: this token is for watching object {scope.object}")
    if scope.camera is not None and (query.zone is not None or query.camera not in {None, scope.camera}):
        return error_response(
            403, f"this token is for watching camera {scope.camera}: no zone, no other camera"
        )
    return None


def _parse_query(request: web.Request, scope: Scope) -> PastQuery:
    """Parse the query; a token for one person searches that person, if it names no other.

    Raises:
        InvalidCommandError, TimeReferenceError: a parameter is invalid.
    """
    service, query = request.app[SERVICE], request.query
    for name in query:
        if name not in {"from", "to", *PAST_SEARCH_QUERIES}:
            raise InvalidCommandError(f"{name[:60]}: there is no such parameter; see /api")
        if len(query.getall(name)) > 1:
            raise InvalidCommandError(f"{name}: is given more than once")
    decided = service.recordings.decided_end
    playback = parse_time_range(request, service, decided)
    end = decided if playback.end is None else min(playback.end, decided)
    start = min(playback.start, end)
    if end - start > _LONGEST_DAYS * _DAY_S * service.config.site.fps:
        raise InvalidCommandError(f"from, to: are more than {_LONGEST_DAYS} days apart")
    order = query.get("order", _DEFAULT.order)
    if order not in _ORDERS:
        raise InvalidCommandError(f"order={order[:60]}: must be one of {', '.join(_ORDERS)}")
    for name in ("zone", "camera"):
        if query.get(name) == "":
            raise InvalidCommandError(f"{name}: is empty; leave it out, or use {ALL} for each")
    person = _parse_number(request, "object", 0, 999_999_999)
    return PastQuery(
        start=start,
        end=end,
        zone=query.get("zone"),
        camera=query.get("camera"),
        person=scope.object if person is None else person,
        gap_s=_parse_seconds(request, "gap_s", _DEFAULT.gap_s),
        min_s=_parse_seconds(request, "min_s", _DEFAULT.min_s),
        order=order,
        limit=_parse_number(request, "limit", 1, _LIMIT_MAX) or _DEFAULT.limit,
        only_camera=scope.camera,
        is_scoped=not scope.is_all,
    )


def _parse_number(request: web.Request, name: str, least: int, most: int) -> int | None:
    text = request.query.get(name)
    if text is None:
        return None
    if not _NUMBER.fullmatch(text) or not least <= int(text) <= most:
        raise InvalidCommandError(f"{name}={text[:60]}: must be a whole number from {least} to {most}")
    return int(text)


def _parse_seconds(request: web.Request, name: str, default: float) -> float:
    text = request.query.get(name)
    if text is None:
        return default
    if not _SECONDS.fullmatch(text) or float(text) > _DAY_S:
        raise InvalidCommandError(f"{name}={text[:60]}: must be seconds from 0 to {_DAY_S}")
    return float(text)
