"""Static files of the web page, from the package ``client``."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from aiohttp import web
from yarl import URL

from server.http.app_keys import SERVICE
from server.http.json_responses import error_response

routes = web.RouteTableDef()

_FOLDER = Path(str(files("client") / "page")).resolve()
_HEADERS = {
    "Cache-Control": "no-cache",  # revalidate each time: an upgraded server must not meet an old page
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",  # a URL may contain the number of the watched person
}


def page_file(name: str, servers: Sequence[str] = ()) -> web.FileResponse:
    """Return a file of the page; it must exist.

    Besides its own server a page may use ``servers``, the site's services, which replace each other.
    """
    own = " ".join(["'self'", *(str(URL(server).origin()) for server in servers)])
    policy = (
        f"default-src 'self'; connect-src {own}; media-src {own} blob:; img-src {own} data: blob:; "
        "frame-ancestors 'none'"  # against clickjacking of the operator's page
    )
    return web.FileResponse(_FOLDER / name, headers=_HEADERS | {"Content-Security-Policy": policy})


@routes.get("/")
async def get_index(request: web.Request) -> web.StreamResponse:
    """Return the page."""
    return page_file("index.html", request.app[SERVICE].config.view.sharding.servers)


@routes.get("/page/{file:.+}")
async def get_file(request: web.Request) -> web.StreamResponse:
    """Return a file of the page."""
    path = _file(request.match_info["file"])
    if path is None:
        return error_response(404, f"there is nothing at {request.path}")
    return web.FileResponse(path, headers=_HEADERS)


def _file(name: str) -> Path | None:
    """Return the path of a file of the page; None: it is outside the folder, or does not exist."""
    try:
        path = (_FOLDER / name).resolve()
        return path if path.is_relative_to(_FOLDER) and path.is_file() else None
    except (OSError, ValueError):  # no valid file name: too long, or with a null character
        return None
