"""The file in which what was said of people by hand outlasts the service."""

from __future__ import annotations

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import msgspec

from camsync import Spell
from server.view.followed import LONGEST_S, Returning, SaidByHand, said_by_hand
from server.view.people import People
from server.wire.errors import UserError
from server.wire.messages import UNREADABLE
from server.wire.output import whole_file

log = logging.getLogger(__name__)

NAME = "by_hand.json"
_EVERY_S = 2.0
"""Seconds between two writings: the file says when it was true."""


def read(path: Path) -> SaidByHand | None:
    """Give what the file says; None: there is none. A damaged one is put aside, and it is said."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=SaidByHand)
    except FileNotFoundError:
        return None
    except (OSError, *UNREADABLE) as error:
        aside = path.with_name(f"{path.name}.damaged")
        log.warning(
            "%s: cannot be read (%s): put aside as %s", path, " ".join(str(error).split()), aside.name
        )
        try:
            path.replace(aside)
        except OSError as failed:
            log.warning("%s: cannot be put aside: %s", path, failed.strerror)
        return None


def write(path: Path, said: SaidByHand) -> None:
    """Write the file: all of it, or it stays as it was.

    Raises:
        UserError: it cannot be written.
    """
    try:
        with whole_file(path) as draft:
            draft.write_bytes(msgspec.json.encode(said))
    except OSError as error:  # the disk is full
        raise UserError(f"{path}: cannot write there: {error.strerror}") from error


class ByHandFile:
    """Reads the file at the start, and keeps it up to date. Another thread waits for the disk.

    ``folder`` is where it is; None: what is said by hand ends with the service.
    """

    def __init__(self, folder: Path | None, site: str, fps: float) -> None:
        self._path = None if folder is None else folder / NAME
        self._site, self._fps = site, fps
        self._returning: Returning | None = None
        self._thread: ThreadPoolExecutor | None = None
        self._writing: Future[None] | None = None
        self._written: SaidByHand | None = None
        """What was written last; None: nothing, and there is no file."""
        self._failing = Spell(calm=0.0)

    def open(self) -> None:
        """Take what an earlier run of the service has left."""
        if self._path is None:
            return
        self._written = read(self._path)
        if self._written is not None:
            self._returning = Returning(self._written, self._site, round(LONGEST_S * self._fps))
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="by hand")

    def take(self, people: People, pulse: int) -> None:
        """Look at people after an epoch that ends with a pulse was taken in; never waits."""
        if self._returning is not None:
            self._returning.look(people, pulse)
            if not self._returning.over:
                return  # nobody who may still come is written over
            self._returning = None
        if self._thread is None or (self._writing is not None and not self._writing.done()):
            return
        said = said_by_hand(people, self._site, pulse)
        before = self._written
        if before is None and not said.people:
            return
        if before is not None and said.people == before.people:
            waits = pulse - before.pulse < _EVERY_S * self._fps
            if waits or not said.people:
                return
        self._written = said
        self._writing = self._thread.submit(self._write, said)

    def close(self) -> None:
        """Wait for what is being written."""
        if self._thread is not None:
            self._thread.shutdown()

    def _write(self, said: SaidByHand) -> None:
        assert self._path is not None  # noqa: S101 — there is a thread only where there is a path
        try:
            write(self._path, said)
        except UserError as error:
            if (more := self._failing.happened(str(error))) is not None:
                log.warning("what was said by hand is not kept: %s%s", error, more)
        else:
            if self._failing.over():
                log.info("what was said by hand is kept again")
