"""Throttled log of accept(2) errors, such as too many open files."""

from __future__ import annotations

import asyncio
import errno
import logging
from typing import Any

from logthrottle import LogThrottle

log = logging.getLogger(__name__)

_OUT_OF_RESOURCES = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})
"""errno of accept(2) where file descriptors or memory are exhausted."""


def is_out_of_resources(error: object) -> bool:
    """Return whether an error says that there are no descriptors, or no memory, for another connection."""
    return isinstance(error, OSError) and error.errno in _OUT_OF_RESOURCES


class AcceptErrors:
    """Logs that connections cannot be accepted: at once, then seldom, with a count."""

    def __init__(self) -> None:
        self._failing = LogThrottle()

    def failed(self, error: OSError) -> None:
        """Note that one was not."""
        reason = error.strerror or str(error)
        if (more := self._failing.record(reason)) is not None:
            log.error("a connection cannot be accepted: %s%s", reason, more)

    def __call__(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Handle what goes wrong in a loop: asyncio says it of each attempt, with a traceback."""
        error = context.get("exception")
        if "socket" in context and isinstance(error, OSError) and is_out_of_resources(error):
            self.failed(error)
        else:
            loop.default_exception_handler(context)
