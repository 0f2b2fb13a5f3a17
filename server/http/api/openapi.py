"""API description: an OpenAPI 3.1 document built from the routes and schemas, and a readable page."""

from __future__ import annotations

import html
import inspect
import re
from functools import cached_property
from importlib.metadata import version
from typing import Any

import msgspec
from aiohttp import web

from server.http.access.permissions import Permission, permission_for
from server.http.access.session_routes import SessionInfo
from server.http.api.past_search import PAST_SEARCH_QUERIES
from server.http.api.schema import Cameras, Delays, FlagList, Objects, Past, SiteInfo
from server.http.json_responses import Problem
from server.http.operator.schema import OPERATOR, OPERATOR_FILES, OPERATOR_RESULTS, TrialProgress
from server.http.streams.request_validation import CAMERA_QUERY, DELAY, OVERLAY, TIME_SHIFT, TRANSCODED
from server.service.facade.past_search import PastSearchResult
from server.service.facade.rules import Rules
from server.service.facade.streams import DelayMode
from server.service.facade.view_selection import ViewSelection

routes = web.RouteTableDef()

_SEARCH = "/api/past/search"
_DELETION = "/api/operator/deletion"

_JSON: dict[str, type[msgspec.Struct]] = {
    "/api/site": SiteInfo,
    "/api/session": SessionInfo,
    "/api/delays": Delays,
    "/api/objects": Objects,
    "/api/cameras": Cameras,
    "/api/flags": FlagList,
    "/api/rules": Rules,
    _SEARCH: PastSearchResult,
    "/api/objects/{object}/choice": ViewSelection,
    "/api/objects/{object}/past": Past,
    "/api/cameras/{camera}/past": Past,
    **OPERATOR,
}
_MEDIA_TYPES = {
    "/objects/{object}/best.mp4": "video/mp4",
    "/cameras/{camera}/live.mp4": "video/mp4",
    "/objects/{object}/best.webm": "video/webm",
    "/cameras/{camera}/live.webm": "video/webm",
    "/objects/{object}/best.ts": "video/mp2t",
    "/cameras/{camera}/live.ts": "video/mp2t",
    "/objects/{object}/hls/index.m3u8": "application/vnd.apple.mpegurl",
    "/objects/{object}/hls/init.mp4": "video/mp4",
    "/objects/{object}/hls/{segment}.m4s": "video/mp4",
    "/objects/{object}/hls/{segment}.{part}.m4s": "video/mp4",
    "/cameras/{camera}/hls/index.m3u8": "application/vnd.apple.mpegurl",
    "/cameras/{camera}/hls/init.mp4": "video/mp4",
    "/cameras/{camera}/hls/{segment}.m4s": "video/mp4",
    "/cameras/{camera}/hls/{segment}.{part}.m4s": "video/mp4",
    "/objects/{object}/best.mjpeg": "multipart/x-mixed-replace",
    "/cameras/{camera}/live.mjpeg": "multipart/x-mixed-replace",
    "/objects/{object}/best.jpg": "image/jpeg",
    "/cameras/{camera}/live.jpg": "image/jpeg",
    "/objects/{object}/thumb.jpg": "image/jpeg",
    "/objects/{object}/whep": "application/sdp",
    "/cameras/{camera}/whep": "application/sdp",
    "/objects/{object}/whep/{session}": "application/sdp",
    "/cameras/{camera}/whep/{session}": "application/sdp",
    "/api/events": "text/event-stream",
    "/api/events/{event}/picture.jpg": "image/jpeg",
    "/api/past": "application/x-ndjson",
    "/healthz": "text/plain",
    "/readyz": "text/plain",
    "/metrics": "text/plain",
    **OPERATOR_FILES,
    **OPERATOR_RESULTS,
}
_UNAVAILABLE = {
    "/objects/{object}/best.mp4",
    "/cameras/{camera}/live.mp4",
    "/readyz",
    "/api/events",
    "/api/past",
    _SEARCH,
} | {
    path
    for path in _MEDIA_TYPES
    if path.endswith((".webm", ".ts", ".m3u8", ".mjpeg", "best.jpg", "live.jpg"))
}
_MAY_BE_UNAVAILABLE_FOR_OPERATORS = {
    "/api/operator/people",
    "/api/operator/position_corrections",
    _DELETION,
}
_NO_FILE = "The site has no configuration file, or refuses the change."
_CONFLICTS = {
    "/api/operator/site_cameras": _NO_FILE,
    "/api/operator/site_settings": _NO_FILE,
    "/api/operator/marked_points": _NO_FILE,
    "/api/operator/zones": _NO_FILE,
    _DELETION: "Another deletion is not complete yet.",
    _SEARCH: "The zone is on the floor, and no camera is calibrated.",
}
_TRIES = {("POST", "/api/operator/site_cameras"), ("POST", "/api/operator/setup/streams")}
"""Operations that speak to a camera, for as long as that takes."""
_FROM_REQUIRED = {"/api/past", _SEARCH, *OPERATOR_FILES}
_RECORDED_SPANS = {"/api/objects/{object}/past", "/api/cameras/{camera}/past"}
_MOMENT = {"type": "string", "examples": ["-60", "p1250", "2026-11-21T16:13:36Z"]}
_SCHEMAS: dict[str, Any] = {
    "object": {"type": "integer", "minimum": 0},
    "camera": {"type": "string"},
    "event": {"type": "string", "pattern": "^[0-9a-f-]{1,64}$"},
    "segment": {"type": "integer", "minimum": 0},
    "session": {"type": "string", "pattern": "^[A-Za-z0-9_-]{22}$"},
    "part": {"type": "integer", "minimum": 0},
    "key": {"type": "integer", "minimum": 0},
    "_HLS_msn": {"type": "integer", "minimum": 0, "description": "The answer waits for this segment."},
    "_HLS_part": {
        "type": "integer",
        "minimum": 0,
        "description": "The answer waits for this part.",
    },
    "delay": {
        "enum": list(DelayMode),
        "default": DelayMode.BALANCED,
        "description": "How much is known of what follows when a view is selected; HLS is never live.",
    },
    "overlay": {"enum": [0, 1], "default": 0, "description": "1: with boxes burnt in."},
    "codec": {"enum": ["h264"], "description": "Encode H.265 or VP8 anew, for players that have neither."},
    "from": {**_MOMENT, "description": "The start: seconds back, a pulse, or a time."},
    "to": {**_MOMENT, "description": "The end, likewise; for HLS also live: no end."},
    "at": {
        **_MOMENT,
        "description": "Within the last minute, and after the first request for this object.",
    },
    "camera_query": {"type": "string", "description": "Show this camera instead of the best one."},
    "prefer": {
        "type": "string",
        "description": "Show this camera while it sees the person.",
    },
    "fps": {
        "type": "number",
        "exclusiveMinimum": 0,
        "description": "Pictures a second, at most the site's.",
    },
}


class ApiDescription:
    """The description of an application's API, built when it is first requested."""

    def __init__(self, app: web.Application) -> None:
        self._app = app

    @cached_property
    def document(self) -> dict[str, Any]:
        """The OpenAPI document."""
        return describe(self._app)

    @cached_property
    def encoded(self) -> bytes:
        """The document as JSON."""
        return msgspec.json.encode(self.document)


DESCRIPTION = web.AppKey("API description", ApiDescription)


def describe(app: web.Application) -> dict[str, Any]:
    """Build the OpenAPI document of an application's routes."""
    _, components = msgspec.json.schema_components(
        [*_JSON.values(), Problem], ref_template="#/components/schemas/{name}"
    )
    paths: dict[str, dict[str, Any]] = {}
    for route in app.router.routes():
        if route.method == "HEAD" or route.resource is None:
            continue
        path = route.resource.canonical
        if path in _JSON or path in _MEDIA_TYPES:
            operation = _operation(path, inspect.getdoc(route.handler) or "", route.method)
            paths.setdefault(path, {})[route.method.lower()] = operation
    return {
        "openapi": "3.1.0",
        "info": {"title": "MyView", "version": version("myview")},
        "paths": dict(sorted(paths.items())),
        "components": {"schemas": components},
    }


def _json_content(struct: type[msgspec.Struct]) -> dict[str, Any]:
    return {"application/json": {"schema": {"$ref": f"#/components/schemas/{struct.__name__}"}}}


def _operation(path: str, summary: str, method: str) -> dict[str, Any]:
    content = _json_content(_JSON[path]) if path in _JSON else {_MEDIA_TYPES[path]: {}}
    error = _json_content(Problem)
    responses: dict[str, Any] = _success(path, content, error)
    if (method, path) in _TRIES:
        description = "It takes longer: ask /api/operator/setup/trials/{key} for the result."
        responses["202"] = {"description": description, "content": _json_content(TrialProgress)}
    names = re.findall(r"\{(\w+)\}", path)
    if names or path in OPERATOR_RESULTS or path in {_SEARCH, _DELETION}:
        responses["404"] = {"description": "No object, camera or file of this name.", "content": error}
    if path in OVERLAY | TIME_SHIFT | CAMERA_QUERY | DELAY | _RECORDED_SPANS or path.endswith("/choice"):
        responses["400"] = {"description": "Invalid query.", "content": error}
    if path in OPERATOR.keys() | OPERATOR_FILES.keys() | OPERATOR_RESULTS.keys() | {_SEARCH}:
        responses["400"] = {"description": "Invalid request.", "content": error}
    if permission_for("GET", path) is not Permission.PUBLIC:
        responses["401"] = {
            "description": "No valid token, where the site has tokens.",
            "content": error,
        }
        responses["403"] = {"description": "Outside the token's scope.", "content": error}
        responses["429"] = {"description": "Too many wrong tokens; try again later.", "content": error}
    if path in _CONFLICTS:
        responses["409"] = {"description": _CONFLICTS[path], "content": error}
    if path in TIME_SHIFT | OPERATOR_FILES.keys():
        responses["416"] = {"description": "That time is not recorded.", "content": error}
    if path in _UNAVAILABLE | _MAY_BE_UNAVAILABLE_FOR_OPERATORS | _RECORDED_SPANS or "object" in names:
        responses["503"] = {"description": "Temporarily unavailable; try again later."}
    parameters = [{"name": name, "in": "path", "required": True, "schema": _SCHEMAS[name]} for name in names]
    queries = ["prefer"] * (path in CAMERA_QUERY) + ["delay"] * (path in DELAY)
    queries += ["codec"] * (path in TRANSCODED)
    queries += ["overlay"] * (path in OVERLAY) + ["fps"] * path.endswith(".mjpeg")
    queries += ["from", "to"] * (path in TIME_SHIFT | _RECORDED_SPANS | OPERATOR_FILES.keys())
    queries += ["from", "to", *PAST_SEARCH_QUERIES] * (path == _SEARCH)
    queries += ["at"] * path.endswith("/choice")
    queries += ["_HLS_msn", "_HLS_part"] * path.endswith(".m3u8")
    if path in CAMERA_QUERY:
        parameters.append(
            {"name": "camera", "in": "query", "required": False, "schema": _SCHEMAS["camera_query"]}
        )
    schemas = _SCHEMAS | (PAST_SEARCH_QUERIES if path == _SEARCH else {})
    parameters += [
        {
            "name": name,
            "in": "query",
            "required": path in _FROM_REQUIRED and name == "from",
            "schema": schemas[name],
        }
        for name in queries
    ]
    return {"summary": summary.splitlines()[0], "parameters": parameters, "responses": responses}


def _success(path: str, content: Any, error: Any) -> dict[str, Any]:
    """Return the responses to a valid request, and WHEP's errors."""
    if path.endswith("/trials/{key}"):
        return {
            "200": {"description": "What the request that began it answers.", "content": {}},
            "202": {"description": "It has no result yet.", "content": content},
        }
    if not path.endswith("/whep"):
        return {"200": {"description": "OK", "content": content}}
    return {
        "201": {"description": "The SDP answer; Location is the session's address.", "content": content},
        "400": {"description": "The SDP offer is invalid, or has no H.264.", "content": error},
        "415": {"description": "Not application/sdp.", "content": error},
        "501": {"description": "The extra webrtc is not installed.", "content": error},
        "503": {"description": "Temporarily unavailable; try again later."},
    }


@routes.get("/api/openapi.json")
async def get_openapi(request: web.Request) -> web.Response:
    """Return the OpenAPI document."""
    return web.Response(body=request.app[DESCRIPTION].encoded, content_type="application/json")


@routes.get("/api")
async def get_readable(request: web.Request) -> web.Response:
    """Return a readable page about the API."""
    rows = "".join(
        f"<tr><td><code>{method.upper()} {html.escape(path)}</code></td>"
        f"<td>{html.escape(operation['summary'])}</td></tr>"
        for path, item in request.app[DESCRIPTION].document["paths"].items()
        for method, operation in [next(iter(item.items()))]
    )
    page = (
        "<!doctype html><html lang=en><meta charset=utf-8><title>MyView: the API</title>"
        "<meta name=viewport content='width=device-width'>"
        "<style>body{font:16px/1.5 system-ui;background:#15171a;color:#dde;margin:2rem auto;max-width:60rem;"
        "padding:0 1rem}td{padding:.3rem 1rem .3rem 0;vertical-align:top}a{color:#6c6}</style>"
        f"<h1>MyView: the API</h1><table>{rows}</table>"
        "<p>Schemas: <a href='/api/openapi.json'>openapi.json</a></p></html>"
    )
    return web.Response(text=page, content_type="text/html")
