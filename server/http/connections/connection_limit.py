"""Connection limit: how many HTTP connections fit into the limit of open file descriptors."""

from __future__ import annotations

from server.config.site_config import Config

FOR_OPERATORS = 32
"""Connections reserved for operators, beyond the limit for all."""
_RESERVED = 128
"""Descriptors reserved for libraries, logs, the bus, the token file and child processes."""
_RESERVED_PER_CAMERA = 8
"""Descriptors for its bus links, its recording, and the pages' requests about it."""
_RESERVED_PER_RENDER_WORKER = 4
"""Descriptors for its pipes and its pidfd."""


def connection_limit(config: Config, descriptors: int) -> int:
    """Compute how many connections can be open at once within a limit of open descriptors.

    Descriptors are reserved for recording, bus, rendering and operators. A viewer of a recording may need a
    file besides the connection.
    """
    http = config.http
    reserved = _RESERVED + _RESERVED_PER_CAMERA * len(config.cameras)
    reserved += _RESERVED_PER_RENDER_WORKER * http.pictures_max
    left = descriptors - reserved - FOR_OPERATORS
    if config.record.folder is not None:
        left = max(left - http.viewers_max, left // 2)
    return max(1, min(http.connections, left))
