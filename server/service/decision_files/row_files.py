"""Text files that grow together, whole rows at a time."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from io import FileIO
from pathlib import Path

from server.system.private_files import open_private


class WholeFiles:
    """Files to which texts are appended: what is appended at once stands in all of them, or in none."""

    def __init__(self, heads: Mapping[Path, str], *, private: bool = False) -> None:
        """Begin new files with their heads, ASCII; ``private``: for this user alone.

        Raises:
            OSError: one cannot be written.
        """
        with contextlib.ExitStack() as opened:
            opener = open_private if private else None
            self._files = {it: opened.enter_context(FileIO(it, "w", opener=opener)) for it in heads}
            self.append(heads)
            self._opened = opened.pop_all()

    def append(self, texts: Mapping[Path, str]) -> None:
        """Append to some of them, ASCII. It is the system's when this returns.

        Raises:
            OSError: that cannot be written; all files are as they were.
        """
        before = {it: self._files[it].tell() for it in texts}
        try:
            for path, text in texts.items():
                _write(self._files[path], text.encode("ascii"))
        except OSError:
            for path, length in before.items():
                with contextlib.suppress(OSError):  # the first one says it
                    self._files[path].truncate(length)
                    self._files[path].seek(length)
            raise

    def close(self) -> None:
        """Close all files."""
        self._opened.close()


def _write(file: FileIO, rest: bytes) -> None:
    """Write all of it: a disk that is nearly full takes a part, and says so only when asked again."""
    while rest:
        rest = rest[file.write(rest) :]
