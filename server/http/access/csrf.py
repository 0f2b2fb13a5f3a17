"""Cross-site request forgery: pages of other sites can change nothing through a browser that is signed in.

Protected are ``/api/session`` and all below ``/api/operator/``. Requests that change something need the
header ``X-MyView-Changes``, which pages of other origins cannot send: browsers ask beforehand (Fetch, 3.2.2),
and are refused.
"""

from __future__ import annotations

from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH, SESSION_PATH
from server.http.json_responses import error_response

CSRF_HEADER = "X-MyView-Changes"
"""The header of a request that changes something."""


def check_csrf(request: web.Request) -> web.Response | None:
    """Return why a request that another site's page may have sent is refused; None: it is not."""
    if not _is_protected(route_pattern(request)):
        return None
    if request.method == "OPTIONS":
        return error_response(403, "this address answers no page of another origin")
    if request.headers.get("Sec-Fetch-Site", "none") not in {"none", "same-origin"}:
        return error_response(403, "this is not possible from another site's page")
    if request.method not in {"GET", "HEAD"} and CSRF_HEADER not in request.headers:
        return error_response(
            403,
            f"{request.method} needs the header {CSRF_HEADER}: 1, which other sites' pages cannot send",
        )
    return None


async def forbid_cross_origin_reads(request: web.Request, response: web.StreamResponse) -> None:
    """Remove the header that lets pages of other origins read an answer."""
    if _is_protected(route_pattern(request)):
        response.headers.popall("Access-Control-Allow-Origin", None)


def route_pattern(request: web.Request) -> str:
    """Return the pattern of the requested route, or the path where there is no such route."""
    resource = request.match_info.route.resource
    return request.path if resource is None else resource.canonical


def _is_protected(path: str) -> bool:
    return path in {OPERATOR_PATH, SESSION_PATH} or path.startswith(f"{OPERATOR_PATH}/")
