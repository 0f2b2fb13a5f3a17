"""Error responses: one line of JSON for each error; an answer that has begun is broken off."""

from __future__ import annotations

import asyncio
import logging
import socket
import struct
from collections.abc import Awaitable, Callable

from aiohttp import web

from logthrottle import LogThrottle
from server.http.json_responses import error_response, unavailable
from server.service.facade.errors import (
    BusyError,
    ConflictError,
    InvalidCommandError,
    RefusedError,
    UnknownCameraError,
    UnknownObjectError,
)

log = logging.getLogger(__name__)

FAILURES = web.AppKey("failures", LogThrottle)
"""Throttles the log of handler errors."""
_BEGUN = web.RequestKey("begun", web.StreamResponse)
"""The response to a request whose head has been sent."""
_RESET_ON_CLOSE = struct.pack("ii", 1, 0)
"""SO_LINGER on, for 0 seconds: the connection is reset instead of closed."""
_STATUS: dict[type[RefusedError], int] = {
    UnknownObjectError: 404,
    UnknownCameraError: 404,
    InvalidCommandError: 400,
    ConflictError: 409,
}


@web.middleware
async def answer_errors(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer every error with one line of JSON; tracebacks go to the log."""
    try:
        return await handler(request)
    except RefusedError as error:
        return refusal(error)
    except web.HTTPException as error:
        if error.status < web.HTTPBadRequest.status_code:
            raise
        return _http_error(request, error)
    except (ConnectionError, asyncio.CancelledError):
        raise
    except Exception as error:
        if (more := request.app[FAILURES].record(repr(error))) is not None:
            log.exception("answering %s %s failed%s", request.method, request.path, more)
        begun: web.StreamResponse | None = request.get(_BEGUN)
        if begun is None:
            return error_response(500, "internal server error; see the server's log")
        break_off(request)
        return begun


def _http_error(request: web.Request, error: web.HTTPException) -> web.Response:
    match error:
        case web.HTTPMethodNotAllowed():
            response = error_response(error.status, f"{request.method} is not possible here")
            response.headers["Allow"] = error.headers["Allow"]
            return response
        case web.HTTPNotFound():
            return error_response(error.status, f"there is nothing at {request.path}")
        case _:
            return error_response(error.status, error.reason)


def refusal(error: RefusedError) -> web.Response:
    """Return the response to a query or command that the service refuses."""
    if isinstance(error, BusyError) or (isinstance(error, UnknownObjectError) and error.is_recovering):
        return unavailable(str(error))
    return error_response(_STATUS[type(error)], str(error))


async def note_begun(request: web.Request, response: web.StreamResponse) -> None:
    """Record that the head of a response is being sent: an error can no longer change its status."""
    request[_BEGUN] = response


def break_off(request: web.Request) -> None:
    """Reset the connection: after an orderly close an HTTP/1.0 client would take the answer for complete."""
    connection = request.get_extra_info("socket")
    if connection is not None:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)
    if request.transport is not None:
        request.transport.abort()
