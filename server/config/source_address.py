"""A camera's ``source``: its notation and its kind."""

from __future__ import annotations

from enum import Enum
from pathlib import Path

from server.system.address_redaction import has_protocol, is_login

_MEMORY = Path("/dev/shm")  # noqa: S108 — nothing is written there
"""Below /dev, and yet of files: a folder in memory."""


class SourceKind(Enum):
    """Where pictures come from."""

    SCENE = "scene"
    """The synthetic scene: ``scene:room?camera=0``."""
    FOLDER = "folder"
    """A folder of images, in the order of their names."""
    FILE = "file"
    """A recording: its moment (n - offset) / fps at pulse n, however busy the machine is."""
    STREAM = "stream"
    """A camera: its newest picture at every pulse."""


def source_kind(source: str) -> SourceKind:
    """Return the kind of a source."""
    if source.startswith("scene:"):
        return SourceKind.SCENE
    if has_protocol(source) or is_device(source):
        return SourceKind.STREAM
    try:
        return SourceKind.FOLDER if Path(source).is_dir() else SourceKind.FILE
    except OSError:
        return SourceKind.FILE  # not for this user, or no name that a file can have: opening it says so


def is_device(source: str) -> bool:
    """Return whether this is a device of this machine, such as ``/dev/video0``, be it there or unplugged."""
    path = Path(source)
    if Path("/dev") not in path.parents:
        return False
    try:
        return path.is_char_device() or (not path.exists() and _MEMORY not in path.parents)
    except OSError:
        return True  # it is there, and not for this user


def path_is_missing(path: str) -> bool:
    """Return whether a path does not exist; one that cannot be accessed is not missing."""
    try:
        Path(path).stat()
    except (FileNotFoundError, NotADirectoryError):
        return True
    except (OSError, ValueError):
        return False
    return False


def resolve_source(source: str, folder: Path) -> str:
    """Make a relative path relative to ``folder`` (the configuration's); leave addresses and scenes alone.

    What looks like an address, or like one without its protocol, and is no file, is none: ``rtsp:host``.
    """
    if source.startswith("scene:") or "://" in source:
        return source
    path = str((folder / source).absolute())
    return source if (has_protocol(source) or is_login(source)) and path_is_missing(path) else path
