"""Deletes old recordings: segments older than ``record.keep_s``, and the oldest beyond ``record.max_mb``.

Segments that are too old are deleted in several passes, an eighth of them in each, and there is one pass per
segment: should a clock or a setting be wrong, the log says so while most of them still exist. What exceeds
the size is deleted at once.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from logthrottle import LogThrottle
from server.service.recording.recording_session import RecordingSegment, RecordingSession
from server.system.errors import reason_of

log = logging.getLogger(__name__)

SEGMENTS_PER_DISK_QUOTA = 8
"""A segment takes at most this part of ``record.max_mb``: only whole segments are deleted."""
_MEGA = 1_000_000
_PASSES = 8
_MIN_SEGMENTS_PER_PASS = 10
_LOG_EVERY_S = 3600.0
"""A full recording loses a segment for each new one: this is logged once per interval."""


@dataclass(frozen=True, slots=True)
class RetentionLimits:
    """The limits on the age and size of the recording."""

    keep_s: float
    max_mb: float
    segment_s: float
    trust_clock: bool = False
    """Whether the time that the machine was off counts by its own clock, synchronized or not."""


@dataclass(slots=True)
class ExpiredSegments:
    """The segments to delete in one pass."""

    segments: list[tuple[RecordingSession, list[RecordingSegment]]] = field(default_factory=list)
    """By session, the oldest first; in each, the oldest segment first."""
    too_old: int = 0
    """The number of segments because of their age."""
    postponed: int = 0
    """The number of segments that are too old, too, and are deleted in a later pass."""
    beyond_size: int = 0
    """The number of segments because of the size of the recording."""

    @property
    def last(self) -> tuple[RecordingSession, RecordingSegment] | None:
        """The newest of them."""
        return next(((session, old[-1]) for session, old in reversed(self.segments) if old), None)


class RetentionPolicy:
    """Deletes what exceeds the limits. ``now`` returns the seconds of the age clock."""

    def __init__(self, limits: RetentionLimits, now: Callable[[], float]) -> None:
        self._limits, self._now = limits, now
        self._segments_per_pass: int | None = None
        """What is deleted in a pass while more segments are too old than one pass may delete."""
        self._unlogged_old = self._unlogged_beyond_size = 0
        self._logged_at = -math.inf
        self._failures = LogThrottle()

    def delete_expired(self, sessions: Sequence[RecordingSession]) -> None:
        """Delete the expired segments of sessions, the oldest first; failures are logged and tried again."""
        expired = self.expired(sessions)
        failed: OSError | None = None
        for session, segments in expired.segments:
            try:
                session.delete(segments)
            except OSError as error:
                failed = error
        if failed is None:
            self._log_deleted(expired)
            self._failures.end()
        elif (more := self._failures.record(reason_of(failed))) is not None:
            failure = f"{failed.filename}: {reason_of(failed)}{more}"
            log.error("recording: cannot delete expired segments: %s; tried again each time", failure)

    def expired(self, sessions: Sequence[RecordingSession]) -> ExpiredSegments:
        """Return what must be deleted of sessions that are sorted by age."""
        oldest = self._now() - self._limits.keep_s
        max_bytes = self._limits.max_mb * _MEGA
        excess = sum(session.size for session in sessions) - (max_bytes - max_bytes / SEGMENTS_PER_DISK_QUOTA)
        old = sum(
            segment.written < oldest and not segment.is_stuck
            for session in sessions
            for segment in session.segments
        )
        quota = self._quota(old)
        expired = ExpiredSegments()
        for session in sessions:
            segments: list[RecordingSegment] = []
            for segment in session.segments:
                is_old = segment.written < oldest and (expired.too_old < quota or segment.is_stuck)
                if not is_old and excess <= 0:
                    break
                segments.append(segment)
                if segment.is_stuck:
                    continue  # it is tried again, but does not count: others must not wait for it
                excess -= segment.bytes
                expired.too_old += is_old
                expired.beyond_size += not is_old
            expired.segments.append((session, segments))
        expired.postponed = max(0, old - expired.too_old - expired.beyond_size)
        return expired

    def _log_deleted(self, expired: ExpiredSegments) -> None:
        self._unlogged_old += expired.too_old
        self._unlogged_beyond_size += expired.beyond_size
        last = expired.last
        if last is None or (not expired.postponed and self._now() - self._logged_at < _LOG_EVERY_S):
            return
        self._logged_at = self._now()
        session, segment = last
        reasons = [
            f"{count} {reason}"
            for count, reason in (
                (self._unlogged_old, f"older than record.keep_s ({self._limits.keep_s:.0f} s)"),
                (self._unlogged_beyond_size, f"beyond record.max_mb ({self._limits.max_mb:.0f} MB)"),
            )
            if count
        ]
        self._unlogged_old = self._unlogged_beyond_size = 0
        level = logging.WARNING if expired.postponed else logging.INFO
        count = expired.postponed
        later = f"; {count} more are too old and are deleted in the next passes" if count else ""
        text = "recording: deleted the oldest segments, up to %s/%d: %s%s"
        log.log(level, text, session.folder.name, segment.first, ", ".join(reasons), later)

    def _quota(self, old: int) -> int:
        """Return how many segments may be deleted because of their age in this pass."""
        if self._segments_per_pass is None:
            self._segments_per_pass = max(_MIN_SEGMENTS_PER_PASS, math.ceil(old / _PASSES))
        quota = self._segments_per_pass
        if old <= quota:
            self._segments_per_pass = None
        return quota
