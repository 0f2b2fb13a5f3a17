"""Playback of one recorded stream: GOP after GOP, from the disk and from memory, up to the present."""

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

_GOPS_PER_READ = 8
"""GOPs read from the disk in one call."""


@dataclass(frozen=True, slots=True)
class SessionEntries:
    """The index of a stream in one session."""

    session: RecordingSession
    index: SegmentIndex


class PlaybackSource(Protocol):
    """One stream that can be played, on the disk and in memory."""

    @property
    def presence(self) -> PresenceHistory | None:
        """Decides what a viewer with access to one person is shown; None: everything is shown."""

    @property
    def recorded(self) -> Sequence[SessionEntries]:
        """Its indexes on the disk, by session."""

    def gop_in_memory_from(self, pulse: int) -> RecordedGop | None:
        """Return the GOP in memory that holds a pulse, or the next one; None if nothing follows."""

    def gop_in_memory_until(self, pulse: int) -> RecordedGop | None:
        """Return the last GOP in memory up to a pulse; None if there is none.

        A person's GOP ends before the pulse; a camera's may hold it, and is cut there.
        """

    @property
    def ranges_in_memory(self) -> Sequence[CameraRange]:
        """The ranges in memory, by camera."""

    @property
    def end(self) -> int:
        """The pulse after the newest frame."""


@dataclass(frozen=True, slots=True)
class PersonPlayback:
    """A person's best view. ``numbers``: the present one, and the one of the request if it was merged."""

    recorder: Recorder
    numbers: tuple[int, ...]
    presence: PresenceHistory | None = None
    """As in :class:`PlaybackSource`."""

    @property
    def recorded(self) -> Sequence[SessionEntries]:
        """The person's indexes on the disk, of sessions in which numbers mean the same persons."""
        return [
            SessionEntries(session, session.objects[number].index)
            for session in self.recorder.sessions_with_same_persons
            for number in self.numbers
            if number in session.objects
        ]

    def gop_in_memory_from(self, pulse: int) -> RecordedGop | None:
        """Return the person's GOP in memory that holds a pulse, or the next one."""
        candidates = [
            gop
            for number in self.numbers
            if (gop := self.recorder.recent.of_person(number, pulse)) is not None
        ]
        return min(candidates, key=lambda gop: gop.first, default=None)

    def gop_in_memory_until(self, pulse: int) -> RecordedGop | None:
        """Return the person's last GOP in memory that ends before a pulse."""
        recent = self.recorder.recent
        candidates = [
            gop for number in self.numbers if (gop := recent.of_person_before(number, pulse)) is not None
        ]
        return max(candidates, key=lambda gop: gop.first, default=None)

    @property
    def ranges_in_memory(self) -> Sequence[CameraRange]:
        """The cameras selected for the person, as far as in memory."""
        return [
            CameraRange(choices.choices[number], choices.first, choices.first + choices.frames)
            for choices in self.recorder.recent.choices(0)
            for number in self.numbers
            if number in choices.choices
        ]

    @property
    def end(self) -> int:
        """The pulse after the newest decided frame."""
        return self.recorder.recent.end


@dataclass(frozen=True, slots=True)
class CameraPlayback:
    """A camera's stream."""

    recorder: Recorder
    camera: str
    presence: None = None

    @property
    def recorded(self) -> Sequence[SessionEntries]:
        """Its indexes on the disk, also of earlier sessions of the same pulses."""
        sessions = [
            session for session in self.recorder.compatible_sessions if self.camera in session.cameras
        ]
        return [SessionEntries(session, session.cameras[self.camera].index) for session in sessions]

    def gop_in_memory_from(self, pulse: int) -> RecordedGop | None:
        """Return its GOP in memory that holds a pulse, or the next one, as far as it has arrived."""
        return self.recorder.recent.of_camera(self.camera, pulse)

    def gop_in_memory_until(self, pulse: int) -> RecordedGop | None:
        """Return its last GOP in memory that begins before a pulse, cut there."""
        return self.recorder.recent.of_camera_until(self.camera, pulse)

    @property
    def ranges_in_memory(self) -> Sequence[CameraRange]:
        """The ranges that have arrived from it, as far as in memory."""
        candidates = []
        gop = self.gop_in_memory_from(0)
        while gop is not None:
            candidates.append(CameraRange(self.camera, gop.first, gop.end))
            gop = self.gop_in_memory_from(gop.end)
        return candidates

    @property
    def end(self) -> int:
        """The pulse after its newest frame."""
        return self.recorder.recent.end_of_camera(self.camera)


def recorded_audio(recorder: Recorder) -> Sequence[SessionEntries]:
    """Return the indexes of the site's audio on the disk."""
    return [SessionEntries(session, session.audio.index) for session in recorder.sessions_with_same_audio]


async def play_gops(source: PlaybackSource, start: int) -> AsyncGenerator[RecordedGop, None]:
    """Yield the GOPs from the one that holds pulse ``start`` to the newest, each once.

    Nothing is awaited between the last GOP and the end: a caller that then subscribes to the live stream
    misses nothing.
    """
    at = start
    is_first = True
    while True:
        on_disk = _next_on_disk(source, at)
        gop = source.gop_in_memory_from(at)
        if gop is not None and (on_disk is None or gop.first <= max(at, on_disk[1].first)):
            yield gop if is_first else _remainder_of(gop, at)
            at, is_first = gop.end, False
        elif on_disk is not None:
            session, entry = on_disk
            async with contextlib.aclosing(_read(session, entry, at)) as reading:
                async for gop in reading:
                    yield gop
                    at, is_first = gop.end, False
            at = max(at, entry.end)  # also if retention has just deleted the file
        else:
            return


async def last_gop_until(source: PlaybackSource, pulse: int) -> RecordedGop | None:
    """Return the last GOP that begins before a pulse, cut there; None if there is none."""
    candidates = [
        (recorded.session, previous)
        for recorded in source.recorded
        if (previous := recorded.index.before(pulse)) is not None
    ]
    session, entry = max(candidates, key=lambda candidate: candidate[1].first, default=(None, None))
    gop = source.gop_in_memory_until(pulse)
    if session is None or entry is None or (gop is not None and gop.end >= min(entry.end, pulse)):
        return gop
    async with contextlib.aclosing(_read(session, entry, min(entry.end, pulse) - 1)) as reading:
        async for last in reading:
            if gop is None or last.first > gop.first:
                return RecordedGop(last.first, last.fragments[: pulse - last.first])
    return gop


def _next_on_disk(source: PlaybackSource, pulse: int) -> tuple[RecordingSession, IndexEntry] | None:
    candidates = [
        (recorded.session, entry)
        for recorded in source.recorded
        if (entry := recorded.index.at_or_after(pulse)) is not None
    ]
    return min(candidates, key=lambda candidate: max(candidate[1].first, pulse), default=None)


def _remainder_of(gop: RecordedGop, pulse: int) -> RecordedGop:
    """Return the frames of a GOP from a pulse on; the earlier ones were yielded already."""
    return RecordedGop(max(gop.first, pulse), gop.fragments[max(0, pulse - gop.first) :])


async def _read(
    session: RecordingSession, entry: IndexEntry, pulse: int
) -> AsyncGenerator[RecordedGop, None]:
    path = session.paths.camera_file(entry.camera, entry.file)
    reading = read_gops(path, entry.offset, entry.length, session.info.fps, pulse)
    try:
        while gops := await run_in_reader_thread(_read_some, reading, pulse):
            for gop in gops:
                yield gop
    finally:
        with contextlib.suppress(ValueError):  # cancelled during a read in the thread: it closes by itself
            reading.close()


def _read_some(reading: Generator[RecordedGop, None, None], pulse: int) -> list[RecordedGop]:
    """Read some GOPs that end after a pulse; none at the end, or if they cannot be read."""
    try:
        return list(islice((gop for gop in reading if gop.end > pulse), _GOPS_PER_READ))
    except OSError:
        return []
