"""What of a run is on the disk: its folder may have been removed, closed, or be on a disk that is gone."""

from __future__ import annotations

import contextlib
import os
import re
from pathlib import Path

from server.service.recording.audio_file import AUDIO_NAME as SOUND
from server.service.recording.playlist_file import CAMERA_PATTERN

MISSING = (FileNotFoundError, NotADirectoryError, IsADirectoryError)
"""What the system says of a file that is not there, or where something else has its name."""
_MEDIA = re.compile(r"[0-9]{1,15}\.mp4")
_OURS = re.compile(
    rf"[0-9]{{1,15}}\.(mp4|jsonl|m3u8|new)|\.?run\.json|init\.mp4|{CAMERA_PATTERN}\.(m3u8|new)"
)
"""Names of the files that are in a run's folder."""


def remove_session_files(folder: Path) -> None:
    """Take away what a run has in a folder, and the folder if nothing else is in it; what is left stays."""
    if folder.is_symlink():
        return
    for inside, folders, names in os.walk(folder, topdown=False):
        for name in names:
            if _OURS.fullmatch(name):
                with contextlib.suppress(OSError):
                    Path(inside, name).unlink()
        for name in folders:
            with contextlib.suppress(OSError):
                Path(inside, name).rmdir()
    with contextlib.suppress(OSError):
        folder.rmdir()


def has_media(folder: Path) -> bool:
    """Tell whether pictures or sound are in a folder that is laid out as a run."""
    files = (*folder.glob("cameras/*/*.mp4"), *folder.glob(f"{SOUND}/*.mp4"))
    return any(it.stem.isdecimal() for it in files)


def media_sizes(folder: Path) -> dict[int, int]:
    """Return the sizes of a folder's files, by the first pulse that they are named by.

    Raises:
        OSError: it cannot be read.
    """
    try:
        with os.scandir(folder) as entries:
            names = [(it.name, it) for it in entries if _MEDIA.fullmatch(it.name)]
            return {int(name[:-4]): file_size(it) for name, it in names}
    except MISSING:
        return {}


def identity_of(folder: Path) -> tuple[int, int] | None:
    """Return what a folder is told by, whatever else gets its name: its disk and its number there."""
    try:
        status = folder.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def is_missing(path: Path) -> bool:
    """Tell whether there surely is no such file: where nobody can tell, there may be one."""
    try:
        path.lstat()
    except MISSING:
        return True
    except OSError:
        return False
    return False


def file_size(file: Path | os.DirEntry[str]) -> int:
    """Return a file's size; 0 where there is none."""
    try:
        return file.stat().st_size
    except OSError:
        return 0
