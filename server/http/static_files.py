"""Static files: the web page, which the client package owns."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from aiohttp import web

from server.http.json_responses import error_response

routes = web.RouteTableDef()

_FOLDER = Path(str(files("client") / "page")).resolve()
_HEADERS = {
    "Cache-Control": "no-cache",  # ask again each time: an upgraded server must not meet an old page
    "Content-Security-Policy": (
        "default-src 'self'; media-src 'self' blob:; img-src 'self' data: blob:; "
        "frame-ancestors 'none'"  # or another site's page could lead a click here, and operate by it
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",  # an address may say who is watched
}


def page_file(name: str) -> web.FileResponse:
    """Return a file of the page that is known to exist."""
    return web.FileResponse(_FOLDER / name, headers=_HEADERS)


@routes.get("/")
async def get_index(request: web.Request) -> web.StreamResponse:
    """Return the page."""
    del request
    return page_file("index.html")


@routes.get("/page/{file:.+}")
async def get_file(request: web.Request) -> web.StreamResponse:
    """Return a file of the page."""
    path = _file(request.match_info["file"])
    if path is None:
        return error_response(404, f"there is nothing at {request.path}")
    return web.FileResponse(path, headers=_HEADERS)


def _file(name: str) -> Path | None:
    """Find one of the page's files; nothing outside its folder."""
    try:
        path = (_FOLDER / name).resolve()
        return path if path.is_relative_to(_FOLDER) and path.is_file() else None
    except (OSError, ValueError):  # a name that no file can have: too long, or with a null in it
        return None
