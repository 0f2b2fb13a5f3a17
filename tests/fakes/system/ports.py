"""Free TCP ports."""

from __future__ import annotations

import socket


def free_port() -> int:
    """Return a free port chosen by the system."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
