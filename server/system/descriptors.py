"""The limit of open file descriptors (files, sockets, pipes) of this process: RLIMIT_NOFILE."""

from __future__ import annotations

import contextlib
import resource

_MOST = 1 << 20
"""More is of no use to anybody, and some systems say that there is no limit at all."""


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


def _within(value: int) -> int:
    return _MOST if value == resource.RLIM_INFINITY else min(value, _MOST)
