"""A fake connection without sockets, and a manual clock."""

from __future__ import annotations

import asyncio
from typing import Any


class ManualClock:
    """A clock that a target sets, Unix seconds."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        """Return the time."""
        return self.now


class FakeWriter(asyncio.Transport):
    """A transport that stores what is written."""

    def __init__(self) -> None:
        super().__init__()
        self.written = b""
        self.closed = False

    @property
    def lines(self) -> list[bytes]:
        """The written lines."""
        *lines, rest = self.written.split(b"\n")
        assert not rest, rest
        return lines

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Store the data."""
        self.written += bytes(data)

    def get_write_buffer_size(self) -> int:
        """Return 0: nothing is buffered."""
        return 0

    def is_closing(self) -> bool:
        """Return whether the transport was closed."""
        return self.closed

    def close(self) -> None:
        """Close the transport."""
        self.closed = True

    abort = close

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        """Return a unique peer address, and a socket without options."""
        return _NoSocket() if name == "socket" else ("client", id(self)) if name == "peername" else default


class _NoSocket:
    def setsockopt(self, *_: object) -> None:
        """Ignore socket options."""
