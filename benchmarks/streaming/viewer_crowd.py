"""A process of many viewers: raw sockets that read streams and record when each GOP has arrived.

    python -m benchmarks.streaming.viewer_crowd PORT

Commands are lines of JSON on standard input, each answered by a line. `{"watch": ["/objects/1/best.mp4", …]}`
replaces the viewers by one for each path; `{"for": 5.0}` reads for that time and returns what arrived.
"""

from __future__ import annotations

import array
import contextlib
import selectors
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import msgspec

_BUFFER = 262_144
_BATCH = 100
"""Connections opened between two reads: fewer than a server's backlog."""
_TFDT = b"tfdt"
_TIME_AT = 8
"""Offset of the time from the box type: version and flags are between."""


@dataclass(frozen=True, slots=True)
class CrowdReading:
    """What all viewers received during a read."""

    megabytes: float
    seconds: float
    processor_s: float
    """Processor seconds of this process."""
    disconnected: int
    """Viewers whose connection was closed."""
    ticks: list[int] = field(default_factory=list)
    """Media time of the last fragment in each received chunk."""
    arrivals: list[float] = field(default_factory=list)
    """Time of arrival of each chunk, seconds of the monotonic clock, which is common to all processes."""


class ViewerCrowd:
    """Viewers of streams of one server."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._selector = selectors.DefaultSelector()
        self._viewers: list[socket.socket] = []
        self._buffer = bytearray(_BUFFER)
        self._disconnected = 0

    def watch(self, paths: Sequence[str]) -> None:
        """Replace the viewers by one for each path."""
        self.leave()
        for index, path in enumerate(paths):
            viewer = socket.create_connection(("127.0.0.1", self._port))
            viewer.sendall(f"GET {path} HTTP/1.1\r\nHost: here\r\n\r\n".encode())
            viewer.settimeout(0.0)
            self._selector.register(viewer, selectors.EVENT_READ)
            self._viewers.append(viewer)
            if index % _BATCH == _BATCH - 1:
                self.read(0.02)

    def leave(self) -> None:
        """Disconnect all viewers."""
        for viewer in self._viewers:
            with contextlib.suppress(KeyError):
                self._selector.unregister(viewer)
            viewer.close()
        self._viewers, self._disconnected = [], 0

    def read(self, seconds: float) -> CrowdReading:
        """Read all streams for some seconds."""
        ticks, arrivals = array.array("q"), array.array("d")
        buffer, total = self._buffer, 0
        began, processor_s = time.monotonic(), time.process_time()
        while (left := began + seconds - time.monotonic()) > 0:
            for key, _ in self._selector.select(left):
                viewer = key.fileobj
                assert isinstance(viewer, socket.socket)  # noqa: S101 — only sockets are registered
                size = self._receive(viewer)
                total += size
                found = buffer.rfind(_TFDT, 0, size)
                if 0 <= found < size - 16:
                    ticks.append(int.from_bytes(buffer[found + _TIME_AT : found + _TIME_AT + 8], "big"))
                    arrivals.append(time.monotonic())
        return CrowdReading(
            total / 1e6,
            time.monotonic() - began,
            time.process_time() - processor_s,
            self._disconnected,
            ticks.tolist(),
            arrivals.tolist(),
        )

    def _receive(self, viewer: socket.socket) -> int:
        try:
            size = viewer.recv_into(self._buffer)
        except BlockingIOError:
            return 0
        except ConnectionError:
            size = 0
        if not size:
            self._selector.unregister(viewer)
            self._disconnected += 1
        return size


class CrowdCommand(msgspec.Struct, forbid_unknown_fields=True):
    """A command: new paths to watch, and how long to read."""

    watch: list[str] | None = None
    seconds: float = msgspec.field(default=0.0, name="for")


def main() -> None:
    """Execute commands until the input ends."""
    crowd = ViewerCrowd(int(sys.argv[1]))
    for line in sys.stdin.buffer:
        command = msgspec.json.decode(line, type=CrowdCommand)
        if command.watch is not None:
            crowd.watch(command.watch)
        sys.stdout.buffer.write(msgspec.json.encode(crowd.read(command.seconds)) + b"\n")
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
