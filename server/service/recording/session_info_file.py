"""The file ``session.json`` of a recording session, and whether it is still in place."""

from __future__ import annotations

import contextlib
from pathlib import Path

import msgspec

from server.service.recording.session_files import INFO_FILE, MISSING, SessionInfo, file_size, identity_of
from server.system.private_files import write_private


class SessionInfoFile:
    """The ``session.json`` of a session's folder, which makes a restart find the session."""

    def __init__(self, folder: Path, info: SessionInfo) -> None:
        self.info = info
        self._folder = folder
        self._identity = identity_of(folder)
        self._bytes = file_size(folder / INFO_FILE)

    @classmethod
    def create(cls, folder: Path, info: SessionInfo) -> SessionInfoFile:
        """Write the file of a new session.

        Raises:
            OSError: the disk does not take it.
        """
        write_private(folder / INFO_FILE, _encode(info))
        return cls(folder, info)

    @classmethod
    def load(cls, folder: Path) -> SessionInfoFile:
        """Read the file of an existing session.

        Raises:
            OSError, msgspec.DecodeError: the folder does not hold a session.
        """
        return cls(folder, msgspec.json.decode((folder / INFO_FILE).read_bytes(), type=SessionInfo))

    def write(self, info: SessionInfo) -> None:
        """Replace the file.

        Raises:
            OSError: the disk does not take it; the file is as before.
        """
        draft = self._folder / f".{INFO_FILE}"
        try:
            write_private(draft, _encode(info))
            draft.replace(self._folder / INFO_FILE)
        except OSError:
            with contextlib.suppress(OSError):
                draft.unlink(missing_ok=True)
            raise
        self.info, self._bytes = info, len(_encode(info))

    @property
    def is_folder_in_place(self) -> bool:
        """Whether the folder is still the same one; it may be removed, or another disk be mounted."""
        return self._identity is not None and identity_of(self._folder) == self._identity

    @property
    def exists(self) -> bool:
        """Whether the file is there, in the same folder; True if that is not known."""
        try:
            return self.is_folder_in_place and (self._folder / INFO_FILE).stat().st_size == self._bytes
        except MISSING:
            return False
        except OSError:
            return True


def _encode(info: SessionInfo) -> bytes:
    return msgspec.json.format(msgspec.json.encode(info)) + b"\n"
