"""How many HTTP connections fit into the limit of open file descriptors."""

from __future__ import annotations

from server.config.site_config import Config

FOR_OPERATORS = 32
"""Connections reserved for operators, beyond the limit for all."""
_KEPT = 128
"""Descriptors for libraries, logs, the bus, the token file and child processes."""
_KEPT_PER_CAMERA = 8
"""Its links over the bus, its recording, the pages' requests about it."""
_KEPT_PER_DRAWING = 4
"""The pipes of a render worker, and its pidfd."""


def connection_limit(config: Config, descriptors: int) -> int:
    """Compute how many connections are accepted at once, within a limit of open descriptors.

    Recording, bus, rendering and operators have reserved ones. A viewer of the past may need a file
    besides the connection.
    """
    http = config.http
    kept = _KEPT + _KEPT_PER_CAMERA * len(config.cameras) + _KEPT_PER_DRAWING * http.pictures_max
    left = descriptors - kept - FOR_OPERATORS
    if config.record.folder is not None:
        left = max(left - http.viewers_max, left // 2)
    return max(1, min(http.connections, left))
