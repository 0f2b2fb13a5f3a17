"""JSON bodies of requests: parsed for the handler, and known to the API description."""

from __future__ import annotations

import functools
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar, runtime_checkable

import msgspec
from aiohttp import web

from server.messaging.messages import DECODE_ERRORS

Body = TypeVar("Body")
Response = TypeVar("Response", bound=web.StreamResponse)


def json_body(
    kind: type[Body],
) -> Callable[
    [Callable[[web.Request, Body], Awaitable[Response]]], Callable[[web.Request], Awaitable[Response]]
]:
    """Pass the JSON body to the handler as an object of this type; a body that is none gets a 400."""

    def decorate(
        handler: Callable[[web.Request, Body], Awaitable[Response]],
    ) -> Callable[[web.Request], Awaitable[Response]]:
        @functools.wraps(handler)
        async def answer(request: web.Request) -> Response:
            return await handler(request, await _read(request, kind))

        answer.body_kind = kind  # type: ignore[attr-defined]
        return answer

    return decorate


def body_kind(handler: Any) -> Any:
    """Return the type of the body that a handler gets; None: it gets none."""
    return getattr(handler, "body_kind", None)


async def _read(request: web.Request, kind: type[Body]) -> Body:
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
