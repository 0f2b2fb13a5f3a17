"""Malformed requests: answered with a status, and not logged, since clients could fill the log."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable

from aiohttp import ClientError, HttpVersion11, web, web_protocol
from aiohttp.http_exceptions import HttpProcessingError

from server.http.json_responses import error_response

AIOHTTP_LOG = logging.getLogger(f"{__name__}.requests")
"""The logger of aiohttp's server."""

_CLIENT_ERRORS = (HttpProcessingError, web_protocol.RequestPayloadError, ClientError)
"""Errors caused by clients, answered with 400 or by closing the connection."""

Handler = Callable[[web.BaseRequest], Awaitable[web.StreamResponse]]


def _is_server_error(record: logging.LogRecord) -> bool:
    """Return whether to log a record: aiohttp also logs tracebacks of errors that clients cause."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, _CLIENT_ERRORS)


AIOHTTP_LOG.addFilter(_is_server_error)


def refuse_expectations(handler: Handler) -> Handler:
    """Wrap a server's handler so that it answers 417 to any Expect header except 100-continue.

    aiohttp would repeat the header in its answer, which fails with a traceback if the header is not text.
    """

    async def handle(request: web.BaseRequest) -> web.StreamResponse:
        expected = request.headers.get("Expect", "").lower()
        if expected and request.version == HttpVersion11 and expected != "100-continue":
            return error_response(417, "Expect: only 100-continue is supported")
        return await handler(request)

    return handle
