"""What a page of another site can make a browser do at the addresses that change something: nothing.

They are ``/api/session`` and what is below ``/api/operator/``. What changes anything needs the head
``X-MyView-Changes``, which a page of another site cannot send: browsers ask beforehand (Fetch, 3.2.2), and
are not answered. Who may operate is asked where it is asked of every address: see ``access.py``.
"""

from __future__ import annotations

from aiohttp import web

from server.http.access.grants import OPERATING, SESSION
from server.http.api.handlers import problem

CHANGES = "X-MyView-Changes"
"""The head of a request that changes something."""


def refused_to_other_sites(request: web.Request) -> web.Response | None:
    """Say why a request that another site's page may have sent is not answered; None: it may be."""
    if not _changes_something(path_of(request)):
        return None
    if request.method == "OPTIONS":
        return problem(403, "this address answers no page of another origin")
    if request.headers.get("Sec-Fetch-Site", "none") not in {"none", "same-origin"}:
        return problem(403, "this is not possible from another site's page")
    if request.method not in {"GET", "HEAD"} and CHANGES not in request.headers:
        return problem(
            403, f"{request.method} needs the head {CHANGES}: 1, which other sites' pages cannot send"
        )
    return None


async def tell_no_other_origin(request: web.Request, response: web.StreamResponse) -> None:
    """Take back that pages of other origins may read an answer, before any of it is sent."""
    if _changes_something(path_of(request)):
        response.headers.popall("Access-Control-Allow-Origin", None)


def path_of(request: web.Request) -> str:
    """Give the pattern of the address that is asked, or the address where there is none."""
    resource = request.match_info.route.resource
    return request.path if resource is None else resource.canonical


def _changes_something(path: str) -> bool:
    return path in {OPERATING, SESSION} or path.startswith(f"{OPERATING}/")
