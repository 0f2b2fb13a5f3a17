"""Private files and folders: only their owner can read them, regardless of the umask."""

from __future__ import annotations

import os
import stat
from pathlib import Path

FOLDER = 0o700
FILE = 0o600
_OTHERS = 0o077


def make_private_folder(path: Path) -> None:
    """Create a folder and its missing parents with mode 700; existing ones are not changed.

    Raises:
        OSError: it cannot be created, or is not a folder.
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
    """Open a file; a new one has mode 600. Usable as ``opener`` of :func:`open`.

    Raises:
        OSError: it cannot be opened.
    """
    return os.open(path, flags, FILE)


def write_private(path: Path, data: bytes) -> None:
    """Write a file in place; a new one has mode 600, an existing one keeps its mode.

    Raises:
        OSError: it cannot be written; part of it may exist.
    """
    with open(path, "wb", opener=open_private) as file:
        file.write(data)


def mode_if_shared(path: Path) -> str:
    """Return the mode of a file or folder, such as ``755``, if others can access it; otherwise an empty text.

    Raises:
        OSError: it does not exist.
    """
    mode = stat.S_IMODE(path.stat().st_mode)
    return f"{mode:o}" if mode & _OTHERS else ""


def rights_of_others(path: Path) -> int:
    """Return the mode bits of a file that are effective for group and others.

    A class that may not enter one of its folders has none. (Of several groups, each counts as the same.)

    Raises:
        OSError: it does not exist.
    """
    path = path.resolve(strict=True)
    rights = path.stat().st_mode & _OTHERS
    for folder in path.parents:
        mode = folder.stat().st_mode
        for search, every in ((stat.S_IXGRP, stat.S_IRWXG), (stat.S_IXOTH, stat.S_IRWXO)):
            if not mode & search:
                rights &= ~every
    return rights


def close_to_others(path: Path) -> None:
    """Remove the rights of others from a file or folder that this user owns; otherwise do nothing.

    Raises:
        OSError: it does not exist, or its mode cannot be changed.
    """
    status = path.stat()
    if status.st_uid == os.geteuid() and status.st_mode & _OTHERS:
        path.chmod(stat.S_IMODE(status.st_mode) & ~_OTHERS)


def is_owned_by_this_user(path: Path) -> bool:
    """Return whether a file or folder exists and belongs to this process's user."""
    try:
        status = path.lstat()
    except OSError:
        return False
    return status.st_uid == os.geteuid() and not stat.S_ISLNK(status.st_mode)
