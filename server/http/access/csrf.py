"""CSRF protection: pages of other sites can change nothing through a browser that is signed in.

``/api/session`` and everything below ``/api/operator/`` are protected. Requests that change something need
the header ``X-MyView-Changes``, which pages of other origins cannot send: the preflight request of their
browser (Fetch, 3.2.2) is refused.
"""

from __future__ import annotations

from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH, SESSION_PATH
from server.http.json_responses import error_response

CSRF_HEADER = "X-MyView-Changes"
"""The header of a request that changes something."""


def check_csrf(request: web.Request) -> web.Response | None:
    """Return 403 for a request that a page of another site may have sent; None: it is acceptable."""
    if not _is_protected(route_pattern(request)):
        return None
    if request.method == "OPTIONS":
        return error_response(403, "pages of other origins may not use this address")
    if request.headers.get("Sec-Fetch-Site", "none") not in {"none", "same-origin"}:
        return error_response(403, "requests from pages of other sites are refused here")
    if needs_csrf_header(request.method, route_pattern(request)) and CSRF_HEADER not in request.headers:
        return error_response(
            403,
            f"{request.method} needs the header {CSRF_HEADER}: 1, which other sites' pages cannot send",
        )
    return None


def needs_csrf_header(method: str, path: str) -> bool:
    """Return whether a request to this route changes something that is protected."""
    return _is_protected(path) and method not in {"GET", "HEAD", "OPTIONS"}


async def remove_cors_header(request: web.Request, response: web.StreamResponse) -> None:
    """Remove the CORS header from the answers of protected routes."""
    if _is_protected(route_pattern(request)):
        response.headers.popall("Access-Control-Allow-Origin", None)


def route_pattern(request: web.Request) -> str:
    """Return the pattern of the requested route, or the path if no route matches."""
    resource = request.match_info.route.resource
    return request.path if resource is None else resource.canonical


def _is_protected(path: str) -> bool:
    return path in {OPERATOR_PATH, SESSION_PATH} or path.startswith(f"{OPERATOR_PATH}/")
