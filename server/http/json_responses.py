"""JSON responses, one-line errors, and parsing of request bodies."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar, runtime_checkable

import msgspec
from aiohttp import web

from server.messaging.messages import DECODE_ERRORS

RETRY_AFTER_S = "5"

Body = TypeVar("Body")


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


async def read_json(request: web.Request, kind: type[Body]) -> Body:
    """Parse the JSON body of a request.

    Raises:
        web.HTTPBadRequest: the body is not valid JSON of this type.
    """
    try:
        with _reading_body(request):
            body = await request.read()
        return msgspec.json.decode(body, type=kind)
    except DECODE_ERRORS as error:
        raise web.HTTPBadRequest(reason=f"the request's JSON: {' '.join(str(error).split())}") from error


@runtime_checkable
class KnowsBodyProgress(Protocol):
    """A connection's protocol that tracks whether a body is still being received."""

    def body_pending(self) -> None:
        """Report that the request's body is still to come."""

    def body_received(self) -> None:
        """Report that the body is complete."""


@contextmanager
def _reading_body(request: web.Request) -> Iterator[None]:
    """Report inside that the body is being received, so that the connection may time out."""
    protocol = request.protocol
    if not isinstance(protocol, KnowsBodyProgress):
        yield
        return
    protocol.body_pending()
    try:
        yield
    finally:
        protocol.body_received()
