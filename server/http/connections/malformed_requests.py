"""Malformed requests: answered by status, and kept out of the log, which clients could fill with them."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable

from aiohttp import ClientError, HttpVersion11, web, web_protocol
from aiohttp.http_exceptions import HttpProcessingError

from server.http.json_responses import error_response

AIOHTTP_LOG = logging.getLogger(f"{__name__}.requests")
"""What aiohttp logs to."""

_CLIENT_ERRORS = (HttpProcessingError, web_protocol.RequestPayloadError, ClientError)
"""Mistakes of clients, which are answered with 400, or by closing the connection."""

Handler = Callable[[web.BaseRequest], Awaitable[web.StreamResponse]]


def _is_server_error(record: logging.LogRecord) -> bool:
    """Keep records of the server's own errors; aiohttp logs a traceback of clients' mistakes, too."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, _CLIENT_ERRORS)


AIOHTTP_LOG.addFilter(_is_server_error)


def refuse_expectations(handler: Handler) -> Handler:
    """Return a server's handler that answers 417 to any Expect header but 100-continue.

    aiohttp's own answer repeats the header, and fails with a traceback where that is not text.
    """

    async def handle(request: web.BaseRequest) -> web.StreamResponse:
        expected = request.headers.get("Expect", "").lower()
        if expected and request.version == HttpVersion11 and expected != "100-continue":
            return error_response(417, "Expect: only 100-continue is supported")
        return await handler(request)

    return handle
