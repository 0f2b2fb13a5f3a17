"""Deletions that have begun, on the disk: one that is interrupted is completed at the next start."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Annotated

import msgspec

from server.messaging.camera_identity_snapshot import PersonNumber, UnixTime
from server.messaging.messages import DECODE_ERRORS
from server.messaging.service_record import DeletedPerson
from server.service.recording.person_removal import SegmentFile
from server.system.errors import reason_of
from server.system.private_files import write_private

JOURNAL_FILE = "deletions.json"
"""In the folder that the deletions are from."""
_KEPT = 1000
"""Completed deletions that are kept, the newest: no more people can be restored from cameras."""
_FILES_MAX = 1_000_000


class Deletion(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The deletion of one person."""

    numbers: list[PersonNumber]
    """All of their numbers."""
    numbers_since: UnixTime | None
    """When the numbers began that these are of; null: those of `sessions` alone."""
    sessions: list[str] = []
    """The folders of the sessions, where no time is known."""
    deletes_media: bool
    """Whether files of video and sound in which they were visible are deleted, too."""
    files: Annotated[dict[str, list[SegmentFile]], msgspec.Meta(max_length=_FILES_MAX)] | None = None
    """By session, these files; null: not found yet."""
    is_done: bool = False

    @property
    def message(self) -> DeletedPerson | None:
        """What other services are told; None: nothing, for their numbers are not known to be the same."""
        if self.numbers_since is None:
            return None
        return DeletedPerson(
            numbers=self.numbers, numbers_since=self.numbers_since, deletes_media=self.deletes_media
        )


class DeletionJournal:
    """The file of deletions in a folder, read once, and replaced at each change; not before the first.

    One that cannot be read is not replaced: it says what is not deleted yet.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / JOURNAL_FILE
        self._deletions: list[Deletion] = []
        self._is_read = False

    def read(self) -> None:
        """Read the file, unless it has been read.

        Raises:
            OSError: it cannot be read, or is damaged; the text says what to do.
        """
        if self._is_read:
            return
        try:
            self._deletions = msgspec.json.decode(self._path.read_bytes(), type=list[Deletion])
        except FileNotFoundError:
            pass
        except (OSError, *DECODE_ERRORS) as error:
            reason = reason_of(error)
            text = f"{self._path}: cannot be read ({reason}): repair it, or move it away and delete again"
            raise OSError(text) from error
        self._is_read = True

    @property
    def all(self) -> list[Deletion]:
        """Deletions that are complete, as far as they are kept, then those that are not."""
        return list(self._deletions)

    @property
    def pending(self) -> list[Deletion]:
        """Deletions that are not complete."""
        return [deletion for deletion in self._deletions if not deletion.is_done]

    def forgotten(self, numbers_since: float) -> set[int]:
        """Return the numbers of the people deleted, of those that began then."""
        return {
            number
            for deletion in self._deletions
            if deletion.numbers_since == numbers_since
            for number in deletion.numbers
        }

    def put(self, deletion: Deletion, before: Deletion | None = None) -> None:
        """Write a deletion, instead of an earlier state of it.

        Raises:
            OSError: writing fails, or what is there cannot be read; nothing has changed.
        """
        self.read()
        others = [each for each in self._deletions if each is not before]
        done = [each for each in others if each.is_done][-_KEPT:]
        deletions = [*done, *(each for each in others if not each.is_done), deletion]
        self._write(deletions)
        self._deletions = deletions

    def _write(self, deletions: list[Deletion]) -> None:
        draft = self._path.with_name(f".{JOURNAL_FILE}")
        try:
            write_private(draft, msgspec.json.format(msgspec.json.encode(deletions)) + b"\n")
            handle = os.open(draft, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)
            draft.replace(self._path)
        except OSError:
            with contextlib.suppress(OSError):
                draft.unlink(missing_ok=True)
            raise
