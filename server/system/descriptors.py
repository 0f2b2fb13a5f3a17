"""The limit of open file descriptors (files, sockets, pipes) of this process: RLIMIT_NOFILE."""

from __future__ import annotations

import contextlib
import resource

_MAX_LIMIT = 1 << 20
"""The limit that is used where the system has a higher one or none."""


def raise_descriptor_limit() -> None:
    """Raise the soft limit of this process, and of those that it starts, to the hard limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = _capped(hard)
    if _capped(soft) < most:
        with contextlib.suppress(OSError, ValueError):  # macOS reports a hard limit that cannot be set
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))


def descriptor_limit() -> int:
    """Return the number of descriptors that this process may have open."""
    return _capped(resource.getrlimit(resource.RLIMIT_NOFILE)[0])


def _capped(value: int) -> int:
    return _MAX_LIMIT if value == resource.RLIM_INFINITY else min(value, _MAX_LIMIT)
