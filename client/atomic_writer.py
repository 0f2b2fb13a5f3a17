"""A file that ends with something whole also where the disk takes no more."""

from __future__ import annotations

from io import FileIO
from typing import Protocol


class Sink(Protocol):
    """Takes bytes one after the other."""

    def write(self, data: bytes, /) -> object:
        """Append all of it.

        Raises:
            OSError: it cannot be written.
        """
        ...


class WholeWriter:
    """Appends to an unbuffered file; of what the disk does not take whole, nothing stays."""

    def __init__(self, file: FileIO) -> None:
        self._file = file

    def write(self, data: bytes) -> None:
        """Append all of it.

        Raises:
            OSError: the disk does not take it; the file is as it was.
        """
        begin, rest = self._file.tell(), memoryview(data)
        try:
            while rest:  # a disk takes what it has room for, and says why no more the next time
                rest = rest[self._file.write(rest) :]
        except OSError:
            self._file.truncate(begin)
            self._file.seek(begin)
            raise
