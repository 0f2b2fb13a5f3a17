"""A port that nobody listens on."""

from __future__ import annotations

import socket


def free() -> int:
    """Return one that the system has chosen, and has let go of again."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
