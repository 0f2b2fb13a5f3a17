"""What strangers send that is no request: how it is answered, and logged, so that it cannot fill a disk."""

from __future__ import annotations

import logging

from aiohttp import ClientError, HttpVersion11, web, web_protocol, web_urldispatcher
from aiohttp.http_exceptions import HttpProcessingError

from server.http.api.handlers import problem

REQUESTS = logging.getLogger(f"{__name__}.requests")
"""What aiohttp logs to."""

_THEIRS = (HttpProcessingError, web_protocol.RequestPayloadError, ClientError)
"""Mistakes of who asks, which are answered with 400, or by hanging up."""


def _is_ours(record: logging.LogRecord) -> bool:
    """Pass on what the server did wrong; aiohttp logs a traceback of what strangers do wrong, too."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, _THEIRS)


REQUESTS.addFilter(_is_ours)


_answer_100_continue = web_urldispatcher._default_expect_handler  # noqa: SLF001 — see below


async def _what_is_expected(request: web.Request) -> web.StreamResponse | None:
    """Answer the head ``Expect``, which aiohttp does before anything of ours is asked."""
    expected = request.headers.get("Expect", "").lower()
    if request.version == HttpVersion11 and expected != "100-continue":
        return problem(417, "Expect: nothing but 100-continue can be expected")
    await _answer_100_continue(request)
    return None


# aiohttp's own repeats what is expected, and fails where that is no text: 500, and a traceback in the log for
# whoever sends it. Addresses that are not there can be given another in no other way.
web_urldispatcher._default_expect_handler = _what_is_expected  # type: ignore[assignment]  # noqa: SLF001
