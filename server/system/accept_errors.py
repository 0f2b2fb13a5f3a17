"""Throttled log of accept(2) errors, for example too many open files."""

from __future__ import annotations

import asyncio
import errno
import logging
from typing import Any

from logthrottle import LogThrottle
from server.system.errors import reason_of

log = logging.getLogger(__name__)

_OUT_OF_RESOURCES = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})
"""errno of accept(2) if file descriptors or memory are exhausted."""


def is_out_of_resources(error: object) -> bool:
    """Return whether an error means that file descriptors or memory are exhausted."""
    return isinstance(error, OSError) and error.errno in _OUT_OF_RESOURCES


def _is_accept_after_close(error: object) -> bool:
    """Return whether asyncio tried to accept on a socket that was closed meanwhile.

    A second after descriptors were exhausted it accepts again, even if the server was closed.
    """
    return isinstance(error, ValueError) and str(error) == "Invalid file descriptor: -1"


class AcceptErrors:
    """Logs failures to accept connections: the first at once, then rarely, with a count."""

    def __init__(self) -> None:
        self._throttle = LogThrottle()

    def failed(self, error: OSError) -> None:
        """Log that a connection could not be accepted."""
        reason = reason_of(error)
        if (more := self._throttle.record(reason)) is not None:
            log.error("a connection cannot be accepted: %s%s", reason, more)

    def __call__(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Handle errors of an event loop: asyncio would log each failure to accept, with a traceback."""
        error = context.get("exception")
        if "socket" in context and isinstance(error, OSError) and is_out_of_resources(error):
            self.failed(error)
        elif not _is_accept_after_close(error):
            loop.default_exception_handler(context)
