"""Files and folders that only their owner can read, whatever the umask."""

from __future__ import annotations

import os
import stat
from pathlib import Path

FOLDER = 0o700
FILE = 0o600
_OTHERS = 0o077


def make_private_folder(path: Path) -> None:
    """Make a folder, and those above it that are missing, for this user alone; others stay as they are.

    Raises:
        OSError: it cannot be made, or no folder has this name.
    """
    try:
        path.mkdir(mode=FOLDER)
    except FileNotFoundError:
        if path.parent == path:
            raise
        make_private_folder(path.parent)
        path.mkdir(mode=FOLDER, exist_ok=True)
    except OSError:
        if not path.is_dir():
            raise


def open_private(path: Path | str, flags: int) -> int:
    """Open a file; one that is made is for this user alone. Fits ``opener`` of :func:`open`.

    Raises:
        OSError: it cannot be opened.
    """
    return os.open(path, flags, FILE)


def write_private(path: Path, data: bytes) -> None:
    """Write a file for this user alone.

    Raises:
        OSError: it cannot be written; part of it may be there.
    """
    with open(path, "wb", opener=open_private) as file:
        file.write(data)


def rights_of_others(path: Path) -> str:
    """Return the mode of a file or folder, such as ``755``, where others have rights to it; else nothing.

    Raises:
        OSError: it is not there.
    """
    mode = stat.S_IMODE(path.stat().st_mode)
    return f"{mode:o}" if mode & _OTHERS else ""


def close_to_others(path: Path) -> None:
    """Take the rights of others away from what is this user's own; anybody else's stays as it is.

    Raises:
        OSError: it is not there, or its rights cannot be changed.
    """
    there = path.stat()
    if there.st_uid == os.geteuid() and there.st_mode & _OTHERS:
        path.chmod(stat.S_IMODE(there.st_mode) & ~_OTHERS)
