"""How many HTTP connections fit into the limit of open file descriptors."""

from __future__ import annotations

from server.config.site_config import Config

FOR_OPERATORS = 32
"""Connections beyond all others' places: an operator gets in when these are taken."""
_KEPT = 128
"""What is open besides: libraries, logs, the bus and its strangers, the tokens' file, child processes."""
_KEPT_PER_CAMERA = 8
"""Its links over the bus, its recording, the pages' requests about it."""
_KEPT_PER_DRAWING = 4
"""The pipes of a process that decodes, and its number."""


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
