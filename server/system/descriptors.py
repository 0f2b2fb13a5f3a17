"""How many descriptors (files, sockets, pipes) a process may have open, and how many of them viewers."""

from __future__ import annotations

import contextlib
import resource
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # every command loads this module, and not all of them a configuration
    from server.config.site_config import Config

FOR_OPERATORS = 32
"""Connections beyond all others' places: an operator gets in when these are taken."""
_MOST = 1 << 20
"""More is of no use to anybody, and some systems say that there is no limit at all."""
_KEPT = 128
"""What is open besides: libraries, logs, the bus and its strangers, the tokens' file, child processes."""
_KEPT_PER_CAMERA = 8
"""Its links over the bus, its recording, the pages' requests about it."""
_KEPT_PER_DRAWING = 4
"""The pipes of a process that decodes, and its number."""


def raise_descriptor_limit() -> None:
    """Let this process, and those that it starts, have as many descriptors open as the system lets it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = _within(hard)
    if _within(soft) < most:
        with contextlib.suppress(OSError, ValueError):  # macOS names a limit that cannot be had
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))


def descriptor_limit() -> int:
    """Return how many descriptors this process may have open."""
    return _within(resource.getrlimit(resource.RLIMIT_NOFILE)[0])


def connection_limit(config: Config, descriptors: int) -> int:
    """Compute how many connections are taken at once where a process may have so many descriptors open.

    Recording, bus, drawing and operators have theirs whatever viewers do. Who watches the past may have a
    file open besides the connection.
    """
    http = config.http
    kept = _KEPT + _KEPT_PER_CAMERA * len(config.cameras) + _KEPT_PER_DRAWING * http.pictures_max
    left = descriptors - kept - FOR_OPERATORS
    if config.record.folder is not None:
        left = max(left - http.viewers_max, left // 2)
    return max(1, min(http.connections, left))


def _within(value: int) -> int:
    return _MOST if value == resource.RLIM_INFINITY else min(value, _MOST)
