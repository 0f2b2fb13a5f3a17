"""Camera sources: the kind of a ``source`` value, and its resolution."""

from __future__ import annotations

from enum import Enum
from pathlib import Path

from server.system.address_redaction import has_protocol, looks_like_login

_MEMORY = Path("/dev/shm")  # noqa: S108 — nothing is written there
"""Below /dev, but a file system in memory."""


class SourceKind(Enum):
    """The kind of a camera's source."""

    SCENE = "scene"
    """The synthetic scene: ``scene:room?camera=0``."""
    FOLDER = "folder"
    """A folder of images, in the order of their names."""
    FILE = "file"
    """A recording: at pulse n its picture at n / fps - offset_s, however busy the machine is."""
    STREAM = "stream"
    """A camera: its newest picture at every pulse."""


def source_kind(source: str) -> SourceKind:
    """Return the kind of a source."""
    if source.startswith("scene:"):
        return SourceKind.SCENE
    if has_protocol(source) or is_device_path(source):
        return SourceKind.STREAM
    try:
        return SourceKind.FOLDER if Path(source).is_dir() else SourceKind.FILE
    except OSError:
        return SourceKind.FILE  # no access, or an invalid file name: opening it reports that


def is_device_path(source: str) -> bool:
    """Return whether this is a device of this machine, such as ``/dev/video0``, plugged in or not."""
    path = Path(source)
    if Path("/dev") not in path.parents:
        return False
    try:
        return path.is_char_device() or (not path.exists() and _MEMORY not in path.parents)
    except OSError:
        return True  # it exists, but this user has no access


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
    """Resolve a relative path against ``folder`` (the configuration's); leave addresses and scenes unchanged.

    A source that looks like an address (``rtsp:host``) is a path only if that exists.
    """
    if source.startswith("scene:") or "://" in source:
        return source
    path = str((folder / source).absolute())
    return source if (has_protocol(source) or looks_like_login(source)) and path_is_missing(path) else path
