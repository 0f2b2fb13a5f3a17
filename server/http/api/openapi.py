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

from server.http.access.csrf import CSRF_HEADER, needs_csrf_header
from server.http.api.openapi_responses import (
    DELETION,
    JSON_ANSWERS,
    MEDIA_TYPES,
    RECORDED_SPANS,
    SEARCH,
    components_of,
    json_content,
    responses_of,
)
from server.http.api.past_search import PAST_SEARCH_QUERIES
from server.http.json_requests import body_kind
from server.http.operator.deletion import DELETION_QUERIES
from server.http.operator.schema import OPERATOR_FILES
from server.http.streams.request_validation import CAMERA_QUERY, DELAY, OVERLAY, TIME_SHIFT, TRANSCODED
from server.service.facade.streams import DelayMode

routes = web.RouteTableDef()

_REQUIRED_QUERIES = {
    **{("GET", path): "from" for path in ("/api/past", SEARCH, *OPERATOR_FILES)},
    ("GET", DELETION): "object",
}
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
    routes = [
        (route.resource.canonical, route)
        for route in app.router.routes()
        if route.method != "HEAD" and route.resource is not None
    ]
    documented = [(path, route) for path, route in routes if path in JSON_ANSWERS or path in MEDIA_TYPES]
    bodies = [body_kind(route.handler) for _, route in documented]
    paths: dict[str, dict[str, Any]] = {}
    for (path, route), body in zip(documented, bodies, strict=True):
        operation = _operation(path, inspect.getdoc(route.handler) or "", route.method, body)
        paths.setdefault(path, {})[route.method.lower()] = operation
    return {
        "openapi": "3.1.0",
        "info": {"title": "MyView", "version": version("myview")},
        "paths": dict(sorted(paths.items())),
        "components": {"schemas": components_of([body for body in bodies if body is not None])},
    }


def _operation(path: str, summary: str, method: str, body: Any) -> dict[str, Any]:
    operation: dict[str, Any] = {
        "summary": summary.splitlines()[0],
        "parameters": _parameters(path, method),
        "responses": responses_of(path, method, has_json_body=body is not None),
    }
    if body is not None:
        operation["requestBody"] = {"required": True, "content": json_content(body)}
    elif method == "POST" and path.endswith("/whep"):
        offer = {"application/sdp": {"schema": {"type": "string"}}}
        operation["requestBody"] = {"required": True, "content": offer}
    return operation


def _parameters(path: str, method: str) -> list[dict[str, Any]]:
    """Return the parameters in an operation's path, query and header."""
    parameters = [
        {"name": name, "in": "path", "required": True, "schema": _SCHEMAS[name]}
        for name in re.findall(r"\{(\w+)\}", path)
    ]
    required = _REQUIRED_QUERIES.get((method, path))
    parameters += [
        {"name": name, "in": "query", "required": name == required, "schema": schema}
        for name, schema in _queries(path, method).items()
    ]
    if needs_csrf_header(method, path):
        parameters.append({"name": CSRF_HEADER, "in": "header", "required": True, "schema": {"const": "1"}})
    return parameters


def _queries(path: str, method: str) -> dict[str, Any]:
    """Return the schemas of an operation's queries by name."""
    names = ["prefer"] * (path in CAMERA_QUERY) + ["delay"] * (path in DELAY)
    names += ["codec"] * (path in TRANSCODED)
    names += ["overlay"] * (path in OVERLAY) + ["fps"] * path.endswith(".mjpeg")
    names += ["from", "to"] * (path in TIME_SHIFT | RECORDED_SPANS | OPERATOR_FILES.keys() | {SEARCH})
    names += ["at"] * path.endswith("/choice")
    names += ["_HLS_msn", "_HLS_part"] * path.endswith(".m3u8")
    queries = {name: _SCHEMAS[name] for name in names}
    if path in CAMERA_QUERY:
        queries["camera"] = {"type": "string", "description": "Show this camera instead of the best one."}
    if path == SEARCH:
        queries |= PAST_SEARCH_QUERIES
    if (method, path) == ("GET", DELETION):
        queries |= DELETION_QUERIES
    return queries


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
        for method, operation in item.items()
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
