"""The index of one recorded stream: which frames are where in which file, in order of pulses."""

from __future__ import annotations

import threading
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class IndexEntry:
    """Consecutive frames of one camera, in one piece of one of its files."""

    camera: str
    file: int
    """The first pulse of the file, which is its name."""
    offset: int
    length: int
    """Bytes."""
    first: int
    frames: int

    @property
    def end(self) -> int:
        """The pulse after its last frame."""
        return self.first + self.frames

    def continues_in(self, other: IndexEntry) -> bool:
        """Return whether the other entry is the next piece of the same file."""
        return (other.camera, other.file, other.offset, other.first) == (
            self.camera,
            self.file,
            self.offset + self.length,
            self.end,
        )


@dataclass(frozen=True, slots=True)
class PulseRange:
    """The pulses ``first … end - 1`` of a stream, without a gap."""

    first: int
    end: int


@dataclass(frozen=True, slots=True)
class CameraRange:
    """The pulses ``first … end - 1``, in which a stream shows one camera."""

    camera: str
    first: int
    end: int


class SegmentIndex:
    """The index entries of one stream by pulse. One thread adds and removes, others read."""

    def __init__(self, entries: Iterable[IndexEntry] = ()) -> None:
        self._lock = threading.Lock()
        self._entries: list[IndexEntry] = []
        for entry in entries:
            self.add(entry)

    def add(self, new: IndexEntry) -> None:
        """Append an entry; one that continues the last in the same file is joined to it."""
        with self._lock:
            last = self._entries[-1] if self._entries else None
            if last is not None and last.continues_in(new):
                self._entries[-1] = replace(
                    last, length=last.length + new.length, frames=last.frames + new.frames
                )
            else:
                self._entries.append(new)

    def drop_segments(self, segments: Collection[int]) -> bool:
        """Remove the entries of segments, by first pulse; return whether there were any."""
        with self._lock:
            before = len(self._entries)
            self._entries = [entry for entry in self._entries if entry.file not in segments]
            return len(self._entries) < before

    def drop_files(self, missing: Collection[tuple[str, int]]) -> bool:
        """Remove the entries of files, by camera and first pulse; return whether there were any."""
        with self._lock:
            before = len(self._entries)
            self._entries = [entry for entry in self._entries if (entry.camera, entry.file) not in missing]
            return len(self._entries) < before

    def at_or_after(self, pulse: int) -> IndexEntry | None:
        """Return the entry that holds a pulse, or the next one; None if nothing follows."""
        with self._lock:
            place = bisect_right(self._entries, pulse, key=lambda entry: entry.end)
            return self._entries[place] if place < len(self._entries) else None

    def before(self, pulse: int) -> IndexEntry | None:
        """Return the last entry that begins before a pulse; None if there is none."""
        with self._lock:
            place = bisect_left(self._entries, pulse, key=lambda entry: entry.first)
            return self._entries[place - 1] if place else None

    def between(self, start: int, end: int) -> list[IndexEntry]:
        """Return the entries that hold any of the pulses ``start … end - 1``, in order."""
        with self._lock:
            place = bisect_right(self._entries, start, key=lambda entry: entry.end)
            after = bisect_left(self._entries, end, lo=place, key=lambda entry: entry.first)
            return self._entries[place:after]

    @property
    def all(self) -> tuple[IndexEntry, ...]:
        """All entries in order."""
        with self._lock:
            return tuple(self._entries)


def merge_camera_ranges(ranges: Iterable[IndexEntry | CameraRange]) -> list[CameraRange]:
    """Join adjacent ranges of one camera; return them in order and without overlap."""
    joined: list[CameraRange] = []
    for part in sorted(ranges, key=lambda part: part.first):
        last = joined[-1] if joined else None
        first = part.first if last is None else max(part.first, last.end)
        if first >= part.end:
            continue
        if last is not None and (last.camera, last.end) == (part.camera, first):
            joined[-1] = CameraRange(part.camera, last.first, part.end)
        else:
            joined.append(CameraRange(part.camera, first, part.end))
    return joined


def merge_pulse_ranges(ranges: Iterable[IndexEntry | PulseRange]) -> list[PulseRange]:
    """Join adjacent and overlapping ranges; return them in order."""
    joined: list[PulseRange] = []
    for part in sorted(ranges, key=lambda part: part.first):
        if joined and part.first <= joined[-1].end:
            joined[-1] = PulseRange(joined[-1].first, max(joined[-1].end, part.end))
        else:
            joined.append(PulseRange(part.first, part.end))
    return joined
