"""A connection without sockets, and a clock that goes where it is put."""

from __future__ import annotations

import asyncio
from typing import Any


class ManualClock:
    """Unix seconds."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        """Return the time."""
        return self.now


class FakeWriter(asyncio.Transport):
    """Keeps what is written instead of sending it."""

    def __init__(self) -> None:
        super().__init__()
        self.written = b""
        self.closed = False

    @property
    def lines(self) -> list[bytes]:
        """What was written, all of it whole lines."""
        *lines, rest = self.written.split(b"\n")
        assert not rest, rest
        return lines

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Keep it."""
        self.written += bytes(data)

    def get_write_buffer_size(self) -> int:
        """Return what waits: nothing."""
        return 0

    def is_closing(self) -> bool:
        """Return whether it was closed."""
        return self.closed

    def close(self) -> None:
        """Be closed."""
        self.closed = True

    abort = close

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        """Be somebody of an address of their own."""
        return _NoSocket() if name == "socket" else ("client", id(self)) if name == "peername" else default


class _NoSocket:
    def setsockopt(self, *_: object) -> None:
        """Have no options."""
