"""Finds the recording sessions that earlier services left in the recording folder."""

from __future__ import annotations

import contextlib
import logging
import re
from collections.abc import Collection
from pathlib import Path

from server.messaging.messages import DECODE_ERRORS
from server.service.recording.age_clock import AgeClock
from server.service.recording.recording_session import RecordingSession
from server.service.recording.session_files import INFO_FILE, MISSING, has_media, remove_session_files
from server.system.private_files import close_to_others

log = logging.getLogger(__name__)

_FOLDER_NAME = re.compile(r"[0-9]{8}T[0-9]{6}Z(-[0-9]+)?")


def load_and_clean_sessions(
    folder: Path, known: Collection[Path], longest_segment_s: float
) -> list[RecordingSession]:
    """Return the sessions in a folder that are not known yet; remains of sessions without media are removed.

    ``longest_segment_s`` is the longest duration of a segment.

    Raises:
        OSError: the folder cannot be read.
    """
    sessions = []
    for inside in sorted(path for path in folder.iterdir() if path not in known):
        try:
            (inside / INFO_FILE).stat()
            session = RecordingSession.load(inside, longest_segment_s)
        except MISSING:
            _remove_remains(inside)
            continue
        except DECODE_ERRORS:
            continue  # not written by MyView, or not to its end: nothing that could be played
        except OSError as error:
            if _FOLDER_NAME.fullmatch(inside.name):
                log.warning("recording: %s: the session is neither played nor deleted", error)
            continue
        with contextlib.suppress(OSError):  # an earlier version's are open to all
            close_to_others(inside)
        sessions.append(session)
    return sessions


def assign_age(session: RecordingSession, clock: AgeClock) -> None:
    """Date a session by the age clock that has no age clock, or another one.

    Such sessions are of an earlier version, or were copied from another folder. The age is that of their
    files if the machine's clock is right; else it is unknown, and they count as new.
    """
    age = 0.0
    if clock.is_wall_clock_trusted:
        written = [_modified(session.paths.decision_file(segment.first)) for segment in session.segments]
        age = max(0.0, clock.wall() - max(written, default=0.0))
    with contextlib.suppress(OSError):  # then it is dated again next time
        session.set_age_clock(clock.id, clock.now - age - session.end / session.info.fps)


def _remove_remains(folder: Path) -> None:
    """Remove a session without ``session.json`` and media; warn if there is media."""
    if not _FOLDER_NAME.fullmatch(folder.name) or not folder.is_dir():
        return
    if has_media(folder):
        log.warning(
            "recording: %s has no %s: the session is neither played nor deleted; restore that file, or "
            "remove the folder",
            folder,
            INFO_FILE,
        )
    else:
        remove_session_files(folder)


def _modified(path: Path) -> float:
    """Return when a file was last written, unix seconds; 0 if there is none."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0
