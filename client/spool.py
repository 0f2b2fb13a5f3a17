"""Temporary storage on the disk until a recording ends, so that memory does not grow with its length."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO


@dataclass(frozen=True, slots=True)
class Place:
    """An entry's position in the spool."""

    offset: int
    length: int


class Spool:
    """Bytes in an unnamed file in ``folder``, created at the first ``put`` and deleted with the process."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file: IO[bytes] | None = None

    def put(self, data: bytes) -> Place:
        """Store bytes.

        Raises:
            OSError: they cannot be written.
        """
        if self._file is None:
            self._file = TemporaryFile(dir=self._folder, buffering=0)  # noqa: SIM115 — see close
        offset = self._file.seek(0, os.SEEK_END)
        if self._file.write(data) < len(data):
            self._file.truncate(offset)
            raise OSError(f"{self._folder}: no room for {len(data)} bytes")
        return Place(offset, len(data))

    def get(self, place: Place) -> bytes:
        """Return stored bytes.

        Raises:
            OSError: they cannot be read.
        """
        if self._file is None:
            return b""
        self._file.seek(place.offset)
        return self._file.read(place.length)

    def close(self) -> None:
        """Delete everything."""
        if self._file is not None:
            self._file.close()
            self._file = None
