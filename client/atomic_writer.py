"""Atomic writes: each is complete, or leaves the file unchanged, for example on a full disk."""

from __future__ import annotations

from io import FileIO
from typing import Protocol


class Sink(Protocol):
    """A destination of bytes."""

    def write(self, data: bytes, /) -> object:
        """Append all of ``data``.

        Raises:
            OSError: it cannot be written.
        """
        ...


class AtomicWriter:
    """Appends to an unbuffered file: each write is complete, or leaves the file unchanged."""

    def __init__(self, file: FileIO) -> None:
        self._file = file

    def write(self, data: bytes) -> None:
        """Append all of ``data``.

        Raises:
            OSError: it cannot be written completely; the file is unchanged.
        """
        begin, remaining = self._file.tell(), memoryview(data)
        try:
            while remaining:  # a full disk accepts a part, and fails at the next write
                remaining = remaining[self._file.write(remaining) :]
        except OSError:
            self._file.truncate(begin)
            self._file.seek(begin)
            raise
