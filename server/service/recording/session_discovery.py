"""The runs that earlier services left in a folder."""

from __future__ import annotations

import contextlib
import logging
import re
from collections.abc import Collection
from pathlib import Path

from server.messaging.messages import DECODE_ERRORS
from server.service.recording.age_clock import AgeClock
from server.service.recording.recording_session import INFO_FILE, RecordingSession
from server.service.recording.session_files import MISSING, has_media, remove_session_files
from server.system.private_files import close_to_others

log = logging.getLogger(__name__)

_RUN_NAME = re.compile(r"[0-9]{8}T[0-9]{6}Z(-[0-9]+)?")


def find_sessions(folder: Path, known: Collection[Path], longest_s: float) -> list[RecordingSession]:
    """Return the runs in a folder but those that are known; what is left of such as hardly began is removed.

    ``longest_s``: of a segment.

    Raises:
        OSError: the folder cannot be read.
    """
    found = []
    for inside in sorted(it for it in folder.iterdir() if it not in known):
        try:
            (inside / INFO_FILE).stat()
            run = RecordingSession.found(inside, longest_s)
        except MISSING:
            _tidy(inside)
            continue
        except DECODE_ERRORS:
            continue  # not written by us, or not to its end: nothing that could be played
        except OSError as error:
            if _RUN_NAME.fullmatch(inside.name):
                log.warning("recording: %s: it is not played, and not taken away either", error)
            continue
        with contextlib.suppress(OSError):  # an earlier version's are open to all
            close_to_others(inside)
        found.append(run)
    return found


def assign_age(run: RecordingSession, clock: AgeClock) -> None:
    """Say when a run went by the recording's clock that went by another one, or by none.

    So does what an earlier version has recorded, and a recording that is put back into another folder. Its
    age is that of its files if the machine's clock is right; else nobody knows it, and it is new.
    """
    age = 0.0
    if clock.is_right:
        written = [_written(run.index_file(it.first)) for it in run.segments]
        age = max(0.0, clock.wall() - max(written, default=0.0))
    with contextlib.suppress(OSError):  # then it is dated again next time
        run.date(clock.id, clock.now - age - run.end / run.head.fps)


def _tidy(folder: Path) -> None:
    """Take away what is left of a run that hardly began; say of which recordings nothing is known."""
    if not _RUN_NAME.fullmatch(folder.name) or not folder.is_dir():
        return
    if has_media(folder):
        log.warning(
            "recording: %s has no %s, so that it is not played, and not taken away either: "
            "put that back, or remove the folder",
            folder,
            INFO_FILE,
        )
    else:
        remove_session_files(folder)


def _written(path: Path) -> float:
    """Return when a file was last written, unix seconds; 0 where there is none."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0
