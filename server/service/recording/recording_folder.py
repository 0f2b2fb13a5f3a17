"""The folder that a site is recorded in: the run that grows, the runs before it, and what may stay.

Everything here waits for the disk: it is for one thread of its own.
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
from server.service.recording.recording_session import (
    InitSegments,
    RecordingSegment,
    RecordingSession,
    SessionInfo,
)
from server.service.recording.retention import SEGMENTS_PER_DISK_QUOTA, RetentionLimits, RetentionPolicy
from server.service.recording.segment_writer import SegmentWriter
from server.service.recording.session_discovery import assign_age, find_sessions
from server.service.recording.session_files import remove_session_files
from server.system.private_files import make_private_folder, open_private

log = logging.getLogger(__name__)

_NOT_THE_RUNS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
"""No room, no more files, no memory: another folder has no more of it. After anything else a run is left."""
_LOCK = ".lock"
_MEGA = 1_000_000
_MACHINE = MachineClocks()


@dataclass(frozen=True, slots=True)
class GopRecord:
    """One decided GOP on its way to the disk."""

    choices: GopChoices
    cameras: dict[str, RecordedGop]
    """What each camera delivered of it, from its first frame on."""
    heard: AudioChunk | None = None
    """What is to be heard meanwhile; None at a site without sound."""


class RecordingFolder:
    """Writes one run after the other, and takes away what is too old or too much."""

    def __init__(self, folder: Path, bounds: RetentionLimits, machine: MachineClocks = _MACHINE) -> None:
        self.folder, self._bounds = folder, bounds
        self._clock = AgeClock(folder, machine, trusted=bounds.trust_clock)
        self._retention = RetentionPolicy(bounds, lambda: self._clock.now)
        self._lock: int | None = None
        self.earlier: list[RecordingSession] = []
        """By age; never changed, but replaced: other threads look at it."""
        self.run: RecordingSession | None = None
        self._open: SegmentWriter | None = None
        self._end = 0
        self._closed_bytes = 0
        self._left, self._stuck = LogThrottle(), LogThrottle()

    def open(self) -> None:
        """Take the folder, and what earlier runs left in it.

        Raises:
            OSError: it cannot be written; a BlockingIOError where another process records there.
        """
        self._take()
        self._retain()

    def write(self, piece: GopRecord, head: SessionInfo, headers: InitSegments) -> None:
        """Write a GOP; ``head`` and ``headers`` are what a run begins with, if it has not begun.

        Where the run cannot be written on, but for want of room, another one is begun: its folder, or one in
        it, may have been removed, closed, or be on a disk that is not there any more.

        Raises:
            OSError: the disk does not take it; :meth:`abandon` is to be called.
        """
        first = piece.choices.first
        self._hold_folder()
        if self._open is not None and (self._begins(first) or self._is_full(self._open.segment, first)):
            self._finish()
        if self._open is None:
            self._retain()  # before anything that takes space: the disk may be full
        try:
            self._put(piece, head, headers)
        except OSError as error:
            if error.errno in _NOT_THE_RUNS:
                raise
            self._leave(error.strerror or str(error))
            self._hold_folder()
            self._put(piece, head, headers)

    def abandon(self) -> None:
        """Let go of the segment that could not be written on; what is in it stays."""
        ended, self._open = self._open, None
        run = self.run
        try:
            if ended is not None:
                if run is not None and ended.is_empty:
                    run.segments = [it for it in run.segments if it is not ended.segment]
                ended.close()
        finally:
            if run is not None and not run.segments:
                self.run = None
                run.remove()

    def close(self) -> None:
        """End the run; the playlists become short."""
        try:
            self._finish()
            if self._lock is not None and is_same_file(self._lock, self.folder / _LOCK):
                self._look_at_the_clock()
        finally:
            if self._lock is not None:
                os.close(self._lock)
                self._lock = None

    def _take(self) -> None:
        """Make the folder if there is none, take it for this process, and look what is in it.

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
        self._look()

    def _look(self) -> None:
        """See which runs there are: those that were known and are there, and such as were not known."""
        runs = [run for run in self.earlier if run.is_there]
        current = self.run if self.run is not None and self.run.is_there else None
        known = {run.folder for run in (*runs, current) if run is not None}
        found = find_sessions(self.folder, known, self._bounds.segment_s)
        if not known:  # else it is their clock that goes
            self._clock.open()
        for run in found:
            if run.head.clock != self._clock.id:
                assign_age(run, self._clock)
            run.stamp(self._clock.now)
        self.earlier = sorted(
            [*runs, *found], key=lambda run: run.segments[-1].written if run.segments else 0.0
        )

    def _hold_folder(self) -> None:
        """Take the folder again if it is another one than before, and let go of a run that is not there.

        Raises:
            OSError: it cannot be written; a BlockingIOError where another process records there.
        """
        if self._lock is None or not is_same_file(self._lock, self.folder / _LOCK):
            self._take()
        if self.run is not None and not self.run.is_there:
            self._leave("it is not there any more")

    def _leave(self, why: str) -> None:
        """End a run that cannot be written on. What there still is of it can be seen on, and gets old."""
        run = self.run
        if run is not None and (more := self._left.record(why)) is not None:
            log.warning("recording: cannot go on in %s: %s%s; a new folder is begun", run.folder, why, more)
        with contextlib.suppress(OSError):
            self.abandon()
        if run is None or self.run is None:
            return
        self.run = None
        if not run.is_in_place:
            return
        with contextlib.suppress(OSError):
            run.forget_missing()
        run.recount()
        if not run.segments:
            run.remove()
            return
        run.tidy()
        if not run.is_there:
            with contextlib.suppress(OSError):
                run.restore_head()
        self.earlier = [*self.earlier, run]

    def _put(self, piece: GopRecord, head: SessionInfo, headers: InitSegments) -> None:
        first, now = piece.choices.first, self._clock.now
        if self._begins(first):
            dated = msgspec.structs.replace(head, clock=self._clock.id, clock0=now - first / head.fps)
            self._begin(dated, headers, first)
        run = self.run
        assert run is not None  # noqa: S101 — it has begun
        if run.head.numbers_since != head.numbers_since:
            run.number_since(head.numbers_since)
        if self._open is None:
            self._open = SegmentWriter(run, RecordingSegment(first, 0, now), headers)
            run.segments.append(self._open.segment)
        self._open.write(piece.choices, piece.cameras, piece.heard, now)
        self._end = first + piece.choices.frames

    def _begins(self, first: int) -> bool:
        """Tell whether a GOP is the first of a run: pulses may begin anew."""
        return self.run is None or first < self._end

    def _begin(self, head: SessionInfo, headers: InitSegments, first: int) -> None:
        name = datetime.fromtimestamp(head.began, UTC).strftime("%Y%m%dT%H%M%SZ")
        taken = {it.name for it in self.folder.glob(f"{name}*")}
        if name in taken:
            name = next(it for number in range(1, len(taken) + 2) if (it := f"{name}-{number}") not in taken)
        folder = self.folder / name
        try:
            begun = RecordingSession.begin(folder, head, headers, self._bounds.segment_s)
        except FileExistsError:
            raise  # it is somebody else's
        except OSError:
            remove_session_files(folder)
            raise
        if self.run is not None:
            self.earlier = [*self.earlier, self.run]
        self.run, self._end = begun, first
        self._closed_bytes = sum(run.size for run in self.earlier)

    def _is_full(self, segment: RecordingSegment, first: int) -> bool:
        run = self.run
        assert run is not None  # noqa: S101 — a segment is of a run
        long_enough = first - segment.first >= self._bounds.segment_s * run.head.fps
        return long_enough or segment.bytes * SEGMENTS_PER_DISK_QUOTA >= self._bounds.most_mb * _MEGA

    def _finish(self) -> None:
        """End the open segment; the playlists that have grown in it become short, if the disk takes it."""
        if self._open is None:
            return
        for playlist in self._open.grown:
            playlist.stale = True
        self.abandon()
        if self.run is not None:
            self.run.tidy()

    def _retain(self) -> None:
        """Take away what is too old, and as much of the oldest as one more segment needs.

        What cannot be taken away is tried again each time, and keeps nobody from recording.
        """
        self._look_at_the_clock()
        runs = [*self.earlier, *([self.run] if self.run else [])]
        due = self._retention.due(runs)
        failed: OSError | None = None
        for run, segments in due.segments:
            try:
                run.drop(segments)
            except OSError as error:
                failed = error
        if failed is None:
            self._retention.tell(due)
            self._stuck.end()
        elif (more := self._stuck.record(failed.strerror or "")) is not None:
            what = f"{failed.filename}: {failed.strerror or failed}{more}"
            log.error("recording: cannot take away what has to go: %s; it is tried again each time", what)
        for run in self.earlier:
            if not run.segments:
                run.remove()
        self.earlier = [run for run in self.earlier if run.segments]
        self._closed_bytes = sum(run.size for run in runs)

    def _look_at_the_clock(self) -> None:
        """Count the time that the machine was off, if it is known now; what came since is no older by it."""
        anchored = self._clock.anchored
        if (away := self._clock.look()) > 0:
            for run in (*self.earlier, *([self.run] if self.run else [])):
                if run is self.run or run.begun >= anchored:
                    run.put_off(away)
        with contextlib.suppress(OSError):  # it goes on from what was written last
            self._clock.keep()

    @property
    def bytes(self) -> int:
        """Bytes on the disk."""
        growing = self._open  # another thread may ask
        return self._closed_bytes + (growing.segment.bytes if growing else 0)
