"""What is recorded of one stream: pieces of the cameras' files, in order."""

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

    def goes_on_in(self, other: IndexEntry) -> bool:
        """Tell whether the other one is the very next piece of the same file."""
        return (other.camera, other.file, other.offset, other.first) == (
            self.camera,
            self.file,
            self.offset + self.length,
            self.end,
        )


@dataclass(frozen=True, slots=True)
class PulseRange:
    """Frames of a stream without a hole: ``first … end - 1``."""

    first: int
    end: int


@dataclass(frozen=True, slots=True)
class CameraRange:
    """Frames of one camera that a stream has shown: ``first … end - 1``."""

    camera: str
    first: int
    end: int


class SegmentIndex:
    """The stretches of one stream by pulse. One thread adds to it and takes away, others look."""

    def __init__(self, stretches: Iterable[IndexEntry] = ()) -> None:
        self._lock = threading.Lock()
        self._stretches: list[IndexEntry] = []
        for stretch in stretches:
            self.add(stretch)

    def add(self, new: IndexEntry) -> None:
        """Add what follows all that is there; what goes on in the same file becomes one stretch."""
        with self._lock:
            last = self._stretches[-1] if self._stretches else None
            if last is not None and last.goes_on_in(new):
                self._stretches[-1] = replace(
                    last, length=last.length + new.length, frames=last.frames + new.frames
                )
            else:
                self._stretches.append(new)

    def drop(self, files: Collection[int]) -> bool:
        """Take away what is in these files; tell whether there was anything."""
        with self._lock:
            before = len(self._stretches)
            self._stretches = [it for it in self._stretches if it.file not in files]
            return len(self._stretches) < before

    def drop_pieces(self, gone: Collection[tuple[str, int]]) -> bool:
        """Take away what is in these cameras' files, of a camera and by first pulse; tell likewise."""
        with self._lock:
            before = len(self._stretches)
            self._stretches = [it for it in self._stretches if (it.camera, it.file) not in gone]
            return len(self._stretches) < before

    def at_or_after(self, pulse: int) -> IndexEntry | None:
        """Give the stretch that holds a pulse, or the next one; None where nothing follows."""
        with self._lock:
            place = bisect_right(self._stretches, pulse, key=lambda it: it.end)
            return self._stretches[place] if place < len(self._stretches) else None

    def before(self, pulse: int) -> IndexEntry | None:
        """Give the last stretch that begins before a pulse; None where there is none."""
        with self._lock:
            place = bisect_left(self._stretches, pulse, key=lambda it: it.first)
            return self._stretches[place - 1] if place else None

    def between(self, start: int, end: int) -> list[IndexEntry]:
        """Give the stretches that hold some of the pulses ``start … end - 1``, in order."""
        with self._lock:
            place = bisect_right(self._stretches, start, key=lambda it: it.end)
            return [it for it in self._stretches[place:] if it.first < end]

    @property
    def all(self) -> tuple[IndexEntry, ...]:
        """All stretches in order."""
        with self._lock:
            return tuple(self._stretches)


def merge_camera_ranges(found: Iterable[IndexEntry | CameraRange]) -> list[CameraRange]:
    """Join what one camera shows on and on; in order, and of no frame two."""
    joined: list[CameraRange] = []
    for it in sorted(found, key=lambda it: it.first):
        last = joined[-1] if joined else None
        first = it.first if last is None else max(it.first, last.end)
        if first >= it.end:
            continue
        if last is not None and (last.camera, last.end) == (it.camera, first):
            joined[-1] = CameraRange(it.camera, last.first, it.end)
        else:
            joined.append(CameraRange(it.camera, first, it.end))
    return joined


def merge_pulse_ranges(stretches: Iterable[IndexEntry | PulseRange]) -> list[PulseRange]:
    """Join what follows without a hole; in order, and nothing twice."""
    joined: list[PulseRange] = []
    for it in sorted(stretches, key=lambda it: it.first):
        if joined and it.first <= joined[-1].end:
            joined[-1] = PulseRange(joined[-1].first, max(joined[-1].end, it.end))
        else:
            joined.append(PulseRange(it.first, it.end))
    return joined
