"""Playing the past: GOP after GOP from the disk and from memory, up to the present."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncGenerator, Generator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Protocol

from server.service.recording.media_files import RecordedGop, read_gops, run_in_reader_thread
from server.service.recording.recorder import Recorder
from server.service.recording.recording_session import RecordingSession
from server.service.recording.segment_index import CameraRange, IndexEntry, SegmentIndex
from server.service.time_shift.presence_history import PresenceHistory

_AT_ONCE = 8
"""GOPs read from the disk in one go."""


@dataclass(frozen=True, slots=True)
class SessionEntries:
    """What a run has recorded of a stream."""

    run: RecordingSession
    tape: SegmentIndex


class PlaybackSource(Protocol):
    """One stream's past."""

    @property
    def presence(self) -> PresenceHistory | None:
        """What it is shown by to who may see one person alone; None: all of it is shown."""

    @property
    def recorded(self) -> Sequence[SessionEntries]:
        """What there is of it on the disk."""

    def recall(self, pulse: int) -> RecordedGop | None:
        """Give the GOP in memory that holds a pulse, or the next one; None where nothing follows."""

    def recall_before(self, pulse: int) -> RecordedGop | None:
        """Give the last GOP in memory that ends before a pulse; None where there is none."""

    @property
    def remembered(self) -> Sequence[CameraRange]:
        """What it shows in memory, by camera."""

    @property
    def end(self) -> int:
        """The pulse after the newest frame."""


@dataclass(frozen=True, slots=True)
class PersonPlayback:
    """Somebody's past. ``numbers``: theirs now, and the one that was asked for."""

    past: Recorder
    numbers: tuple[int, ...]
    presence: PresenceHistory | None = None
    """As of :class:`PlaybackSource`."""

    @property
    def recorded(self) -> Sequence[SessionEntries]:
        """What there is of them on the disk: of no run whose numbers are other people's."""
        return [
            SessionEntries(run, run.objects[number].tape)
            for run in self.past.numbered
            for number in self.numbers
            if number in run.objects
        ]

    def recall(self, pulse: int) -> RecordedGop | None:
        """Give their GOP in memory that holds a pulse, or the next one."""
        found = [gop for it in self.numbers if (gop := self.past.recent.of_object(it, pulse)) is not None]
        return min(found, key=lambda gop: gop.first, default=None)

    def recall_before(self, pulse: int) -> RecordedGop | None:
        """Give their last GOP in memory that ends before a pulse."""
        recent = self.past.recent
        found = [gop for it in self.numbers if (gop := recent.of_object_before(it, pulse)) is not None]
        return max(found, key=lambda gop: gop.first, default=None)

    @property
    def remembered(self) -> Sequence[CameraRange]:
        """What was chosen for them, as far as it is remembered."""
        return [
            CameraRange(it.choices[number], it.first, it.first + it.frames)
            for it in self.past.recent.choices(0)
            for number in self.numbers
            if number in it.choices
        ]

    @property
    def end(self) -> int:
        """The pulse after the newest decided frame."""
        return self.past.recent.end


@dataclass(frozen=True, slots=True)
class CameraPlayback:
    """A camera's past."""

    past: Recorder
    camera: str
    presence: None = None

    @property
    def recorded(self) -> Sequence[SessionEntries]:
        """What there is of it on the disk, also of earlier runs by the same pulses."""
        runs = [run for run in self.past.runs if self.camera in run.cameras]
        return [SessionEntries(run, run.cameras[self.camera].tape) for run in runs]

    def recall(self, pulse: int) -> RecordedGop | None:
        """Give its GOP in memory that holds a pulse, or the next one, as far as it has come."""
        return self.past.recent.of_camera(self.camera, pulse)

    def recall_before(self, pulse: int) -> RecordedGop | None:
        """Give its last GOP in memory that ends before a pulse."""
        return self.past.recent.of_camera_before(self.camera, pulse)

    @property
    def remembered(self) -> Sequence[CameraRange]:
        """What it delivered, as far as it is in memory."""
        found = []
        gop = self.recall(0)
        while gop is not None:
            found.append(CameraRange(self.camera, gop.first, gop.end))
            gop = self.recall(gop.end)
        return found

    @property
    def end(self) -> int:
        """The pulse after its newest frame."""
        return self.past.recent.end_of_camera(self.camera)


def recorded_audio(past: Recorder) -> Sequence[SessionEntries]:
    """Say what there is of the site's sound on the disk."""
    return [SessionEntries(run, run.sound.tape) for run in past.sounding]


async def play_gops(source: PlaybackSource, start: int) -> AsyncGenerator[RecordedGop, None]:
    """Give the GOPs from the one that holds pulse ``start`` to the newest; nothing is given twice.

    Between its last GOP and its end nothing is awaited: whoever joins the stream at once misses nothing.
    """
    at = start
    fresh = True
    while True:
        on_disk = _next_on_disk(source, at)
        gop = source.recall(at)
        if gop is not None and (on_disk is None or gop.first <= max(at, on_disk[1].first)):
            yield gop if fresh else _from(gop, at)
            at, fresh = gop.end, False
        elif on_disk is not None:
            run, stretch = on_disk
            async with contextlib.aclosing(_read(run, stretch, at)) as reading:
                async for gop in reading:
                    yield gop
                    at, fresh = gop.end, False
            at = max(at, stretch.end)  # also where retention has just taken the file away
        else:
            return


async def last_gop_before(source: PlaybackSource, pulse: int) -> RecordedGop | None:
    """Give the last GOP that begins before a pulse, up to there; None where nothing is kept of that time."""
    found = [(one.run, it) for one in source.recorded if (it := one.tape.before(pulse)) is not None]
    run, stretch = max(found, key=lambda it: it[1].first, default=(None, None))
    gop = source.recall_before(pulse)
    if run is None or stretch is None or (gop is not None and gop.end >= min(stretch.end, pulse)):
        return gop
    async with contextlib.aclosing(_read(run, stretch, min(stretch.end, pulse) - 1)) as reading:
        async for last in reading:
            if gop is None or last.first > gop.first:
                return RecordedGop(last.first, last.fragments[: pulse - last.first])
    return gop


def _next_on_disk(source: PlaybackSource, pulse: int) -> tuple[RecordingSession, IndexEntry] | None:
    found = [(one.run, it) for one in source.recorded if (it := one.tape.at_or_after(pulse)) is not None]
    return min(found, key=lambda it: max(it[1].first, pulse), default=None)


def _from(gop: RecordedGop, pulse: int) -> RecordedGop:
    """Leave out what has been given already of a GOP that was not whole yet."""
    return RecordedGop(max(gop.first, pulse), gop.fragments[max(0, pulse - gop.first) :])


async def _read(run: RecordingSession, stretch: IndexEntry, pulse: int) -> AsyncGenerator[RecordedGop, None]:
    path = run.camera_file(stretch.camera, stretch.file)
    reading = read_gops(path, stretch.offset, stretch.length, run.head.fps, pulse)
    try:
        while some := await run_in_reader_thread(_some, reading, pulse):
            for gop in some:
                yield gop
    finally:
        with contextlib.suppress(
            ValueError
        ):  # whoever left did so while it was being read: it closes by itself
            reading.close()


def _some(reading: Generator[RecordedGop, None, None], pulse: int) -> list[RecordedGop]:
    """Read some GOPs that end after a pulse; none where there are no more, or they cannot be read."""
    try:
        return list(islice((gop for gop in reading if gop.end > pulse), _AT_ONCE))
    except OSError:
        return []
