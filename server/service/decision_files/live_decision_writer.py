"""Writes the decisions of a running site to files; a full disk does not stop the site."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from server.media.letterbox import Letterbox
from server.service.decision_files.decision_writer import DecisionWriter
from server.service.decision_files.row_removal import (
    INTENT_FILE,
    complete_earlier_runs,
    copy_without,
    remove_from_earlier_runs,
    set_numbers_since,
    write_intent,
)
from server.service.recording.media_files import run_in_reader_thread
from server.service.rules.engine import SiteEvent
from server.service.view_selection.decider import GopDecision
from server.service.view_selection.delay_modes import ModeDecision
from server.system.errors import UserError, reason_of

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class _LateFrame:
    """A row of ``late.csv``: a late or missing frame, and the reason."""

    pulse: int
    camera: str
    reason: str

    @property
    def row(self) -> str:
        return f"{self.pulse + 1},{self.camera},{self.reason}\n"


class LiveDecisionWriter:
    """Writes the files of a running site (:class:`DecisionWriter`), and late frames to ``late.csv``.

    A full disk does not end the streams: whole decisions are skipped until there is room again, and then
    ``late.csv`` lists the frames that are missing.
    """

    def __init__(self, folder: Path, cameras: Sequence[str], letterboxes: Mapping[str, Letterbox]) -> None:
        """Create the files, readable by this user alone, in a folder, which may exist.

        Raises:
            OSError: a file cannot be written.
        """
        self._folder = folder
        self._writer = DecisionWriter(folder, cameras, letterboxes, private=True)
        self._late: list[_LateFrame] = []
        self._numbers_since = 0.0
        try:
            if complete_earlier_runs(folder):
                log.info("%s: completed the deletion of a person that was interrupted", folder)
        except (OSError, ValueError) as error:
            log.error("%s: an interrupted deletion cannot be completed: %s", folder, error)  # noqa: TRY400
        self._missing = range(0)
        """Pulses of skipped decisions that ``late.csv`` does not list yet."""

    def add_late(self, camera: str, pulses: Sequence[int], reason: str) -> None:
        """Add late frames; they are written with the next decision."""
        self._late += (_LateFrame(pulse, camera, reason) for pulse in pulses)

    def set_numbers_since(self, since: float) -> None:
        """Write when person numbers began, unix seconds; it may become known after the start."""
        if since != self._numbers_since:
            with contextlib.suppress(OSError):  # tried again with the next decision
                set_numbers_since(self._folder, since)
                self._numbers_since = since

    def write_or_skip(self, decision: GopDecision, events: Sequence[SiteEvent] = ()) -> None:
        """Write a decision and the events that it has led to; skip them if writing fails."""
        try:
            self._writer.write(decision, events, self._rows())
        except OSError as error:
            self._skip(decision, error)
            return
        if self._missing:
            log.info("%s: writing again; %d frames are missing", self._folder, len(self._missing))
        self._missing = range(0)
        self._late.clear()

    def write_views_or_skip(self, decision: ModeDecision) -> None:
        """Write the choices for viewers with another delay; skip them if writing fails."""
        with contextlib.suppress(OSError):  # the balanced decisions report it
            self._writer.write_views(decision)

    async def forget(self, numbers: Collection[int]) -> None:
        """Remove people's rows from the files; decisions that are made later must not have them.

        Raises:
            OSError: writing fails; the rest is removed when a service starts here again.
        """
        await run_in_reader_thread(write_intent, self._folder, numbers)
        await run_in_reader_thread(remove_from_earlier_runs, self._folder, numbers)
        for path, size in self._writer.sizes.items():
            draft = path.with_suffix(".new")
            await run_in_reader_thread(copy_without, path, draft, size, numbers)
            self._writer.replace(path, draft, size, numbers)
        (self._folder / INTENT_FILE).unlink(missing_ok=True)

    def close(self) -> None:
        """Write the pending late frames, and close the files."""
        try:
            self._writer.write_late(self._rows())
        except OSError as error:
            log.warning("%s: the end of late.csv could not be written: %s", self._folder, reason_of(error))
        self._late.clear()
        self._writer.close()

    def _skip(self, decision: GopDecision, error: OSError) -> None:
        if not self._missing:
            log.error(
                "%s: cannot write: %s; decisions are skipped until writing succeeds; the streams continue",
                self._folder,
                reason_of(error),
            )
        last = decision.first + decision.frames
        self._missing = range(self._missing.start if self._missing else decision.first, last)
        self._late = [frame for frame in self._late if frame.pulse not in self._missing]

    def _rows(self) -> list[str]:
        rows = [frame.row for frame in self._late]
        if self._missing:
            rows.append(f"{self._missing.start + 1},,not written up to {self._missing.stop}\n")
        return rows


def open_decision_files(
    folder: Path, cameras: Sequence[str], letterboxes: Mapping[str, Letterbox]
) -> LiveDecisionWriter:
    """Return the writer of a running site's files in a folder.

    Raises:
        UserError: a file cannot be written.
    """
    try:
        return LiveDecisionWriter(folder, cameras, letterboxes)
    except OSError as error:
        raise UserError(f"{folder}: cannot write there: {reason_of(error)}") from error
