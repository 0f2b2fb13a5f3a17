"""JSON responses and one-line errors."""

from __future__ import annotations

from typing import Any

import msgspec
from aiohttp import web

RETRY_AFTER_S = "5"


class Problem(msgspec.Struct, frozen=True):
    """An error."""

    error: str


def json_response(content: Any, status: int = 200) -> web.Response:
    """Return content as a JSON response that any origin may read and that is not cached."""
    return web.Response(
        body=msgspec.json.encode(content),
        status=status,
        content_type="application/json",
        headers={"Cache-Control": "no-store", "Access-Control-Allow-Origin": "*"},
    )


def error_response(status: int, error: str) -> web.Response:
    """Return an error as one line of JSON."""
    return json_response(Problem(error), status)


def unavailable(error: str) -> web.Response:
    """Return 503 with a Retry-After header."""
    response = error_response(503, error)
    response.headers["Retry-After"] = RETRY_AFTER_S
    return response
