"""The folder that a site is recorded in: the run that grows, the runs before it, and what may stay.

Everything here waits for the disk: it is for one thread of its own.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from server.view.media.heard import Heard
from server.view.past.media import Gop
from server.view.past.run import HEAD, Headers, Run, RunHead, Segment
from server.view.past.segment import OpenSegment
from server.wire.messages import UNREADABLE, GopChoices

_SHARE = 8
"""A segment takes at most this part of the disk that the recording may take: only whole segments go."""
_MEGA = 1_000_000


@dataclass(frozen=True, slots=True)
class Piece:
    """One decided GOP on its way to the disk."""

    choices: GopChoices
    cameras: dict[str, Gop]
    """What each camera delivered of it, from its first frame on."""
    heard: Heard | None = None
    """What is to be heard meanwhile; None at a site without sound."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """How much is kept."""

    keep_s: float
    most_mb: float
    segment_s: float


class Store:
    """Writes one run and takes away what is too old or too much. ``now`` gives unix seconds."""

    def __init__(self, folder: Path, bounds: Bounds, now: Callable[[], float] = time.time) -> None:
        self.folder, self._bounds, self._now = folder, bounds, now
        self._lock: int | None = None
        self.earlier: list[Run] = []
        self.run: Run | None = None
        self._open: OpenSegment | None = None
        self._end = 0
        self._closed_bytes = 0

    def open(self) -> None:
        """Take the folder, and what earlier runs left in it.

        Raises:
            OSError: it cannot be written; a BlockingIOError where another process records there.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock = os.open(self.folder / ".lock", os.O_WRONLY | os.O_CREAT, 0o666)
        fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        for head in sorted(self.folder.glob(f"*/{HEAD}")):
            try:
                self.earlier.append(Run.found(head.parent, self._bounds.segment_s))
            except UNREADABLE:
                continue  # not written by us, or not to its end: nothing that could be played
        with contextlib.suppress(OSError):  # it is tried again before anything is written, and told then
            self._retain()

    def write(self, piece: Piece, head: RunHead, headers: Headers) -> None:
        """Write a GOP; ``head`` and ``headers`` are what a run begins with, if it has not begun.

        Raises:
            OSError: the disk does not take it; :meth:`abandon` is to be called.
        """
        first = piece.choices.first
        begins = self.run is None or first < self._end
        if self._open is not None and (begins or self._is_full(self._open.segment, first)):
            self._finish()
        if self._open is None:
            self._retain()  # before anything that takes space: the disk may be full
        if begins:
            self._begin(head, headers)
        run = self.run
        assert run is not None  # noqa: S101 — it has begun
        if run.head.numbers_since != head.numbers_since:
            run.number_since(head.numbers_since)
        if self._open is None:
            self._open = OpenSegment(run, Segment(first, 0, self._now()), headers)
            run.segments.append(self._open.segment)
        self._open.write(piece.choices, piece.cameras, piece.heard, self._now())
        self._end = first + piece.choices.frames

    def abandon(self) -> None:
        """Let go of the segment that could not be written on; what is in it stays."""
        if self._open is None:
            return
        ended, self._open = self._open, None
        ended.close()

    def close(self) -> None:
        """End the run; the playlists become short."""
        try:
            self._finish()
        finally:
            if self._lock is not None:
                os.close(self._lock)
                self._lock = None

    def _begin(self, head: RunHead, headers: Headers) -> None:
        name = datetime.fromtimestamp(head.began, UTC).strftime("%Y%m%dT%H%M%SZ")
        taken = sorted(it.name for it in self.folder.glob(f"{name}*"))
        folder = self.folder / (f"{name}-{len(taken)}" if taken else name)
        try:
            begun = Run.begin(folder, head, headers, self._bounds.segment_s)
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        if self.run is not None:
            self.earlier.append(self.run)
        self.run = begun

    def _is_full(self, segment: Segment, first: int) -> bool:
        run = self.run
        assert run is not None  # noqa: S101 — a segment is of a run
        long_enough = first - segment.first >= self._bounds.segment_s * run.head.fps
        return long_enough or segment.bytes * _SHARE >= self._bounds.most_mb * _MEGA

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
        """Take away the oldest segments: those that are too old, and as many as one more needs.

        Raises:
            OSError: some cannot be taken away; all others are.
        """
        runs = [*self.earlier, *([self.run] if self.run else [])]
        oldest = self._now() - self._bounds.keep_s
        most = self._bounds.most_mb * _MEGA
        too_much = sum(run.size for run in runs) - (most - most / _SHARE)
        failed: OSError | None = None
        for run in runs:
            old: list[Segment] = []
            for segment in run.segments:
                if segment.written >= oldest and too_much <= 0:
                    break
                old.append(segment)
                too_much -= segment.bytes
            try:
                run.drop(old)
            except OSError as error:
                failed = error
        for run in [run for run in self.earlier if not run.segments]:
            self.earlier.remove(run)
            shutil.rmtree(run.folder, ignore_errors=True)
        self._closed_bytes = sum(run.size for run in runs)
        if failed is not None:
            raise failed

    @property
    def bytes(self) -> int:
        """Bytes on the disk."""
        growing = self._open  # another thread may ask
        return self._closed_bytes + (growing.segment.bytes if growing else 0)
