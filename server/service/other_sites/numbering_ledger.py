"""Which numbers of other sites this site's recordings have: when those began, for each of its own numberings.

A person's number is that of one site, and means them for as long as that site's numbers have not begun anew.
The ledger is kept beside the recordings, so that people deleted elsewhere are found in those of earlier runs.
"""

from __future__ import annotations

import contextlib
import logging
from pathlib import Path
from typing import Annotated

import msgspec

from server.messaging.camera_identity_snapshot import UnixTime
from server.messaging.messages import DECODE_ERRORS
from server.messaging.site_people import SiteIndex
from server.system.address_redaction import located_reason_of
from server.system.errors import reason_of
from server.system.private_files import write_private

log = logging.getLogger(__name__)

LEDGER_FILE = "sites.json"
_KEPT = 1000
"""Rows kept, the newest."""


class Numbering(msgspec.Struct, frozen=True):
    """Numbers of another site that a numbering of this one has."""

    own_since: UnixTime
    index: SiteIndex
    """The other site's."""
    since: UnixTime
    """When its numbers began."""


_Rows = Annotated[list[Numbering], msgspec.Meta(max_length=10 * _KEPT)]


class NumberingLedger:
    """The file in a folder; without a folder, in memory."""

    def __init__(self, folder: Path | None) -> None:
        self._path = None if folder is None else folder / LEDGER_FILE
        self._rows: list[Numbering] = []

    @property
    def has_file(self) -> bool:
        """Whether there is a folder."""
        return self._path is not None

    def read(self) -> None:
        """Read the file, if there is one; one that is damaged is logged and counts as empty."""
        if self._path is None:
            return
        try:
            self._rows = msgspec.json.decode(self._path.read_bytes(), type=_Rows)
        except FileNotFoundError:
            pass
        except (OSError, *DECODE_ERRORS) as error:
            log.error(  # noqa: TRY400
                "%s: cannot be read (%s): people deleted at other sites stay in recordings of earlier runs",
                self._path,
                reason_of(error),
            )

    def add(self, own_since: float, index: int, since: float) -> bool:
        """Add a row; return whether it is new."""
        row = Numbering(own_since, index, since)
        if row in self._rows:
            return False
        self._rows = [*self._rows, row][-_KEPT:]
        return True

    def write(self) -> None:
        """Write the file; an error is logged, and the file unchanged."""
        if self._path is None:
            return
        draft = self._path.with_name(f".{LEDGER_FILE}")
        try:
            write_private(draft, msgspec.json.format(msgspec.json.encode(self._rows)) + b"\n")
            draft.replace(self._path)
        except OSError as error:
            log.error("record.folder: %s", located_reason_of(error))  # noqa: TRY400
            with contextlib.suppress(OSError):
                draft.unlink(missing_ok=True)

    def own_numberings(self, index: int, since: float) -> list[float]:
        """Return when those of this site's numberings began that have these numbers of another site."""
        return [row.own_since for row in self._rows if (row.index, row.since) == (index, since)]

    def numberings(self, own_since: float, index: int) -> list[float]:
        """Return when the numbers of another site began that a numbering of this one has."""
        return [row.since for row in self._rows if (row.own_since, row.index) == (own_since, index)]
