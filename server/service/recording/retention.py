"""What of the recordings has to go: what is older than it may be, and the oldest of what is too much.

What is too old goes in parts, an eighth of it in a pass, and a pass is as long as a segment: should a clock
or a setting be wrong all the same, the log says so while most of it is still there. What is too much goes at
once.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from server.service.recording.recording_session import RecordingSegment, RecordingSession

log = logging.getLogger(__name__)

SEGMENTS_PER_DISK_QUOTA = 8
"""A segment takes at most this part of the disk that the recording may take: only whole segments go."""
_MEGA = 1_000_000
_PASSES = 8
"""What is too old goes in so many passes,"""
_AT_LEAST = 10
"""of so many segments at least."""
_TOLD_EVERY_S = 3600.0
"""A recording that is full loses a segment for each new one: that is told so seldom."""


@dataclass(frozen=True, slots=True)
class RetentionLimits:
    """How much is kept."""

    keep_s: float
    most_mb: float
    segment_s: float
    trust_clock: bool = False
    """The time that the machine was off counts by its clock, whoever keeps that."""


@dataclass(slots=True)
class ExpiredSegments:
    """What has to go in one pass."""

    segments: list[tuple[RecordingSession, list[RecordingSegment]]] = field(default_factory=list)
    """The oldest run first, and in each the oldest segment."""
    old: int = 0
    """Segments that go because of their age,"""
    held: int = 0
    """and such that are as old, and go later."""
    over: int = 0
    """Segments that go because of what they take."""

    @property
    def last(self) -> tuple[RecordingSession, RecordingSegment] | None:
        """The newest of them."""
        return next(((run, them[-1]) for run, them in reversed(self.segments) if them), None)


class RetentionPolicy:
    """Says what has to go. ``now`` is the recording's own clock."""

    def __init__(self, bounds: RetentionLimits, now: Callable[[], float]) -> None:
        self._bounds, self._now = bounds, now
        self._quota: int | None = None
        """Segments that go in a pass while there are more of them than may go at once."""
        self._untold_old = self._untold_over = 0
        self._told_at = -math.inf

    def due(self, runs: Sequence[RecordingSession]) -> ExpiredSegments:
        """Say what has to go of the recordings, which are sorted by age."""
        oldest = self._now() - self._bounds.keep_s
        most = self._bounds.most_mb * _MEGA
        too_much = sum(run.size for run in runs) - (most - most / SEGMENTS_PER_DISK_QUOTA)
        old = sum(it.written < oldest and not it.is_stuck for run in runs for it in run.segments)
        quota = self._share_of(old)
        due = ExpiredSegments()
        for run in runs:
            goes: list[RecordingSegment] = []
            for segment in run.segments:
                is_old = segment.written < oldest and (due.old < quota or segment.is_stuck)
                if not is_old and too_much <= 0:
                    break
                goes.append(segment)
                if segment.is_stuck:
                    continue  # it is tried again, but may not be in the way of others
                too_much -= segment.bytes
                due.old += is_old
                due.over += not is_old
            due.segments.append((run, goes))
        due.held = max(0, old - due.old - due.over)
        return due

    def tell(self, due: ExpiredSegments) -> None:
        """Say in the log what has gone, and why."""
        self._untold_old += due.old
        self._untold_over += due.over
        last = due.last
        if last is None or (not due.held and self._now() - self._told_at < _TOLD_EVERY_S):
            return
        self._told_at = self._now()
        run, segment = last
        whys = [
            f"{count} {why}"
            for count, why in (
                (self._untold_old, f"older than record.keep_s ({self._bounds.keep_s:.0f} s)"),
                (self._untold_over, f"beyond record.most_mb ({self._bounds.most_mb:.0f} MB)"),
            )
            if count
        ]
        self._untold_old = self._untold_over = 0
        level = logging.WARNING if due.held else logging.INFO
        later = f"; {due.held} more are too old and go in the next passes" if due.held else ""
        text = "recording: took away the oldest segments, up to %s/%d: %s%s"
        log.log(level, text, run.folder.name, segment.first, ", ".join(whys), later)

    def _share_of(self, old: int) -> int:
        """Say how many segments may go because of their age in this pass."""
        if self._quota is None:
            self._quota = max(_AT_LEAST, math.ceil(old / _PASSES))
        quota = self._quota
        if old <= quota:
            self._quota = None
        return quota
