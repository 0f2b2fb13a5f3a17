"""What is logged of requests that are none: nothing that a stranger could fill a disk with."""

from __future__ import annotations

import logging

from aiohttp import ClientError, web_protocol
from aiohttp.http_exceptions import HttpProcessingError

REQUESTS = logging.getLogger(f"{__name__}.requests")
"""What aiohttp logs to."""

_THEIRS = (HttpProcessingError, web_protocol.RequestPayloadError, ClientError)
"""Mistakes of who asks, which are answered with 400, or by hanging up."""


def _is_ours(record: logging.LogRecord) -> bool:
    """Pass on what the server did wrong; aiohttp logs a traceback of what strangers do wrong, too."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, _THEIRS)


REQUESTS.addFilter(_is_ours)
