"""The folder that a site is recorded to: the session in progress and the earlier ones.

All of it blocks on the disk, and runs in the writer thread.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import logging
import os
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from logthrottle import LogThrottle
from server.media.audio.audio_chunk import AudioChunk
from server.messaging.messages import GopChoices
from server.service.recording.age_clock import AgeClock, MachineClocks
from server.service.recording.media_files import RecordedGop, is_same_file
from server.service.recording.recording_session import RecordingSegment, RecordingSession
from server.service.recording.retention import SEGMENTS_PER_DISK_QUOTA, RetentionLimits, RetentionPolicy
from server.service.recording.segment_writer import SegmentWriter
from server.service.recording.session_discovery import assign_age, load_and_clean_sessions
from server.service.recording.session_files import InitSegments, RecordingSessionInfo, remove_session_files
from server.system.errors import reason_of
from server.system.private_files import make_private_folder, open_private

log = logging.getLogger(__name__)

_NO_RESOURCES = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
"""Errors that a new session would not avoid: no space, files or memory. After other errors one is created."""
_LOCK = ".lock"
_MEGA = 1_000_000
_MACHINE = MachineClocks()


@dataclass(frozen=True, slots=True)
class GopRecord:
    """One decided GOP on its way to the disk."""

    choices: GopChoices
    cameras: dict[str, RecordedGop]
    """By camera, the frames that arrived, up to the first that is missing."""
    audio: AudioChunk | None = None
    """The audio of the GOP; None at a site without audio."""


class RecordingFolder:
    """Writes one session after another, and deletes what exceeds the retention limits."""

    def __init__(self, folder: Path, limits: RetentionLimits, machine: MachineClocks = _MACHINE) -> None:
        self.folder, self._limits = folder, limits
        self._clock = AgeClock(folder, machine, trust_clock=limits.trust_clock)
        self._retention = RetentionPolicy(limits, lambda: self._clock.now)
        self._lock: int | None = None
        self.earlier: list[RecordingSession] = []
        """By age. The list is replaced, never changed: other threads read it."""
        self.session: RecordingSession | None = None
        self._open: SegmentWriter | None = None
        self._end = 0
        self._closed_bytes = 0
        self._abandoned_sessions = LogThrottle()

    def open(self) -> None:
        """Lock the folder, and read the sessions in it.

        Raises:
            OSError: it cannot be written; a BlockingIOError where another process records there.
        """
        self._lock_folder()
        self._apply_retention()

    def write(self, record: GopRecord, info: RecordingSessionInfo, init: InitSegments) -> None:
        """Write a GOP; ``info`` and ``init`` are for a new session, if one begins with it.

        If the session cannot be continued, for another reason than a lack of space, a new one begins: its
        folder may have been removed, made unwritable, or be on a disk that is no longer mounted.

        Raises:
            OSError: writing fails; the caller must call :meth:`abandon_segment`.
        """
        first = record.choices.first
        self._check_folder()
        if self._open is not None and (
            self._begins_session(first) or self._is_full(self._open.segment, first)
        ):
            self._close_segment()
        if self._open is None:
            self._apply_retention()  # before anything that takes space: the disk may be full
        try:
            self._append(record, info, init)
        except OSError as error:
            if error.errno in _NO_RESOURCES:
                raise
            self._leave_session(reason_of(error))
            self._check_folder()
            self._append(record, info, init)

    def abandon_segment(self) -> None:
        """Abandon the open segment, which could not be continued; its files stay."""
        ended, self._open = self._open, None
        session = self.session
        try:
            if ended is not None:
                if session is not None and ended.is_empty:
                    session.segments = [
                        segment for segment in session.segments if segment is not ended.segment
                    ]
                ended.close()
        finally:
            if session is not None and not session.segments:
                self.session = None
                session.remove_files()

    def end_segment(self) -> None:
        """End the open segment: the next GOP begins another, and no file is written to until then.

        Raises:
            OSError: writing fails.
        """
        self._close_segment()

    @property
    def sessions(self) -> list[RecordingSession]:
        """All sessions, the oldest first, this service's last; any thread may read it."""
        current = self.session
        return [*self.earlier, *([] if current is None else [current])]

    def close(self) -> None:
        """End the session, rewrite its playlists, save the age clock, and unlock the folder."""
        try:
            self._close_segment()
            if self._lock is not None and is_same_file(self._lock, self.folder / _LOCK):
                self._update_age_clock()
        finally:
            if self._lock is not None:
                os.close(self._lock)
                self._lock = None

    def _lock_folder(self) -> None:
        """Create the folder if there is none, lock it for this process, and read the sessions in it.

        Raises:
            OSError: it cannot be written; a BlockingIOError where another process records there.
        """
        make_private_folder(self.folder)
        lock = open_private(self.folder / _LOCK, os.O_WRONLY | os.O_CREAT)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(lock)
            raise BlockingIOError(error.errno, "another process records there") from error
        except OSError:
            os.close(lock)
            raise
        if self._lock is not None:
            os.close(self._lock)
        self._lock = lock
        self._find_sessions()

    def _find_sessions(self) -> None:
        """Drop sessions that do not exist any more, and add those that were not known."""
        sessions = [session for session in self.earlier if session.is_loadable]
        current = self.session if self.session is not None and self.session.is_loadable else None
        known = {session.folder for session in (*sessions, current) if session is not None}
        discovered = load_and_clean_sessions(self.folder, known, self._limits.segment_s)
        if not known:  # else the age clock is running
            self._clock.open()
        for session in discovered:
            if session.info.age_clock != self._clock.id:
                assign_age(session, self._clock)
            session.set_written_times(self._clock.now)
        self.earlier = sorted(
            [*sessions, *discovered],
            key=lambda session: session.segments[-1].written if session.segments else 0.0,
        )

    def _check_folder(self) -> None:
        """Lock the folder again if it is another one than before, and leave a session that was removed.

        Raises:
            OSError: it cannot be written; a BlockingIOError where another process records there.
        """
        if self._lock is None or not is_same_file(self._lock, self.folder / _LOCK):
            self._lock_folder()
        if self.session is not None and not self.session.is_loadable:
            self._leave_session("it does not exist any more")

    def _leave_session(self, reason: str) -> None:
        """End a session that cannot be continued; what is left of it is played and ages like others."""
        session = self.session
        if session is not None and (more := self._abandoned_sessions.record(reason)) is not None:
            log.warning(
                "recording: cannot continue in %s: %s%s; starting a new folder", session.folder, reason, more
            )
        with contextlib.suppress(OSError):
            self.abandon_segment()
        if session is None or self.session is None:
            return
        self.session = None
        if not session.is_in_place:
            return
        with contextlib.suppress(OSError):
            session.forget_missing_entries()
        session.recount()
        if not session.segments:
            session.remove_files()
            return
        session.rewrite_stale_playlists()
        if not session.is_loadable:
            with contextlib.suppress(OSError):
                session.restore_info()
        self.earlier = [*self.earlier, session]

    def _append(self, record: GopRecord, info: RecordingSessionInfo, init: InitSegments) -> None:
        first, now = record.choices.first, self._clock.now
        if self._begins_session(first):
            dated_info = msgspec.structs.replace(
                info, age_clock=self._clock.id, age_clock_at_pulse0=now - first / info.fps
            )
            self._begin_session(dated_info, init, first)
        session = self.session
        assert session is not None  # noqa: S101 — it was created above
        if session.info.person_numbers_since != info.person_numbers_since:
            session.set_person_numbers_since(info.person_numbers_since)
        if self._open is None:
            self._open = SegmentWriter(session, RecordingSegment(first, 0, now), init)
            session.segments.append(self._open.segment)
        self._open.write(record.choices, record.cameras, record.audio, now)
        self._end = first + record.choices.frames

    def _begins_session(self, first: int) -> bool:
        """Return whether a GOP begins a session: the pulses may have started again."""
        return self.session is None or first < self._end

    def _begin_session(self, info: RecordingSessionInfo, init: InitSegments, first: int) -> None:
        name = datetime.fromtimestamp(info.started, UTC).strftime("%Y%m%dT%H%M%SZ")
        existing = {path.name for path in self.folder.glob(f"{name}*")}
        if name in existing:
            name = next(
                candidate
                for number in range(1, len(existing) + 2)
                if (candidate := f"{name}-{number}") not in existing
            )
        folder = self.folder / name
        try:
            created = RecordingSession.create(folder, info, init, self._limits.segment_s)
        except FileExistsError:
            raise  # not made by this process
        except OSError:
            remove_session_files(folder)
            raise
        if self.session is not None:
            self.earlier = [*self.earlier, self.session]
        self.session, self._end = created, first
        self._closed_bytes = sum(session.size for session in self.earlier)

    def _is_full(self, segment: RecordingSegment, first: int) -> bool:
        session = self.session
        assert session is not None  # noqa: S101 — a segment belongs to a session
        long_enough = first - segment.first >= self._limits.segment_s * session.info.fps
        return long_enough or segment.bytes * SEGMENTS_PER_DISK_QUOTA >= self._limits.max_mb * _MEGA

    def _close_segment(self) -> None:
        """End the open segment, and rewrite the playlists that it has grown, if writing succeeds."""
        if self._open is None:
            return
        for playlist in self._open.playlists:
            playlist.is_stale = True
        self.abandon_segment()
        if self.session is not None:
            self.session.rewrite_stale_playlists()

    def _apply_retention(self) -> None:
        """Delete what is too old, and as much of the oldest as one more segment needs.

        What cannot be deleted is tried again each time, and does not stop the recording.
        """
        self._update_age_clock()
        sessions = self.sessions
        self._retention.delete_expired(sessions)
        for session in self.earlier:
            if not session.segments:
                session.remove_files()
        self.earlier = [session for session in self.earlier if session.segments]
        self._closed_bytes = sum(session.size for session in sessions)

    def _update_age_clock(self) -> None:
        """Count the time that the machine was off, once it is known; newer sessions do not age by it."""
        anchored = self._clock.anchored
        if (off_s := self._clock.add_off_time()) > 0:
            for session in self.sessions:
                if session is self.session or session.age_clock_at_start >= anchored:
                    session.make_younger(off_s)
        with contextlib.suppress(OSError):  # a restart continues from what was written last
            self._clock.save()

    @property
    def bytes(self) -> int:
        """Bytes on the disk."""
        writer = self._open  # another thread may read it
        return self._closed_bytes + (writer.segment.bytes if writer else 0)
