"""Line buffer and rate limit for bytes from untrusted peers."""

from __future__ import annotations

from collections.abc import Iterator


class OverlongLineError(ValueError):
    """A line is longer than the limit; the rest of the stream cannot be parsed."""


class LineBuffer:
    """Cuts a stream of bytes into lines of at most ``limit`` bytes, without the line end (LF or CR LF)."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._rest = b""

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Yield the lines that ``data`` completes.

        Raises:
            OverlongLineError: a line, finished or not, exceeds the limit.
        """
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest[: self._limit + 1]
        for line in lines:
            self._check(line)
            yield line.removesuffix(b"\r")
        self._check(rest)

    def _check(self, line: bytes) -> None:
        if len(line) > self._limit:
            raise OverlongLineError(f"a line is longer than {self._limit} bytes")


class RateLimit:
    """A token bucket: ``burst`` lines at once, ``rate`` lines per second in the long run."""

    def __init__(self, burst: float, rate: float, now: float) -> None:
        self._burst = burst
        self._rate = rate
        self._left = burst
        self._at = now

    def take(self, now: float) -> bool:
        """Count one line at ``now`` (seconds); False when the limit is exceeded."""
        self._left = min(self._burst, self._left + max(0.0, now - self._at) * self._rate)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
