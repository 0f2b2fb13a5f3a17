"""One session of the service on the disk: its segments, and the playlists that refer to them."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import msgspec

from server.service.recording.playlist_file import RecordingPlaylist
from server.service.recording.segment_index import IndexEntry
from server.service.recording.session_files import (
    AUDIO,
    INFO_FILE,
    INIT_FILE,
    MISSING,
    InitSegments,
    RecordingSessionInfo,
    RecordingSessionInfoFile,
    SessionPaths,
    file_size,
    is_missing,
    media_sizes,
    remove_session_files,
)
from server.system.private_files import FOLDER, write_private


@dataclass(slots=True)
class RecordingSegment:
    """The files that begin with one pulse: one per camera, that of the audio, and their index."""

    first: int
    bytes: int
    written: float
    """When something was last added, in seconds of the age clock."""
    is_stuck: bool = False
    """Whether some of its files could not be deleted."""


class RecordingSession:
    """The folder of one session, this service's or an earlier one's.

    ``longest_segment_s`` is the longest duration of a segment.
    """

    def __init__(
        self, folder: Path, info_file: RecordingSessionInfoFile, init: InitSegments, longest_segment_s: float
    ) -> None:
        self.folder, self.init = folder, init
        self._info_file = info_file
        self.paths = SessionPaths(folder, self.info.cameras)
        self._longest_s = longest_segment_s
        self.segments: list[RecordingSegment] = []
        self.objects: dict[int, RecordingPlaylist] = {}
        self.cameras = {
            camera: self._playlist(folder / "cameras" / f"{camera}.m3u8") for camera in self.info.cameras
        }
        self.audio = self._playlist(folder / f"{AUDIO}.m3u8", init_path=f"{AUDIO}/{INIT_FILE}")

    @property
    def info(self) -> RecordingSessionInfo:
        """The content of ``session.json``."""
        return self._info_file.info

    @classmethod
    def create(
        cls, folder: Path, info: RecordingSessionInfo, init: InitSegments, longest_segment_s: float
    ) -> RecordingSession:
        """Create the folder of a new session.

        Raises:
            OSError: it cannot be created.
        """
        folder.mkdir(mode=FOLDER)  # its parent is made elsewhere: it may have been removed since
        for name in ("cameras", "objects", "index"):
            (folder / name).mkdir(mode=FOLDER)
        write_private(folder / "cameras" / INIT_FILE, init.video)
        if init.audio:
            (folder / AUDIO).mkdir(mode=FOLDER)
            write_private(folder / AUDIO / INIT_FILE, init.audio)
        return cls(folder, RecordingSessionInfoFile.create(folder, info), init, longest_segment_s)

    @classmethod
    def load(cls, folder: Path, longest_segment_s: float) -> RecordingSession:
        """Read a session that an earlier service left.

        Raises:
            OSError, msgspec.DecodeError: the folder does not hold a session.
        """
        info_file = RecordingSessionInfoFile.load(folder)
        init = SessionPaths(folder, info_file.info.cameras).init_segments()
        session = cls(folder, info_file, init, longest_segment_s)
        for playlist in (*session.cameras.values(), session.audio):
            if playlist.path.exists():
                playlist.read()
        for path in sorted((folder / "objects").glob("*.m3u8")):
            if path.stem.isdecimal():
                session.person(int(path.stem)).read()
        starts = session.paths.segment_starts()
        session.segments = [RecordingSegment(first, 0, 0.0) for first in sorted(starts)]
        session.recount()
        existing = {segment.first for segment in session.segments}
        for playlist in session.playlists:  # files may have been deleted since it was written
            playlist.drop_segments({entry.file for entry in playlist.index.all} - existing)
        with contextlib.suppress(OSError):  # drafts of a process that was killed
            for draft in (*folder.rglob("*.new"), folder / f".{INFO_FILE}"):
                draft.unlink(missing_ok=True)
        return session

    def set_person_numbers_since(self, since: float | None) -> None:
        """Write when the person numbers began: it may become known after the first GOP.

        Raises:
            OSError: writing fails.
        """
        self._info_file.write(msgspec.structs.replace(self.info, person_numbers_since=since))

    def set_age_clock(self, clock: str, at_pulse0: float) -> None:
        """Write which age clock applies, and its seconds at pulse 0.

        Raises:
            OSError: writing fails.
        """
        info = msgspec.structs.replace(self.info, age_clock=clock, age_clock_at_pulse0=at_pulse0)
        self._info_file.info = info  # it applies even if it cannot be written
        self._info_file.write(info)

    @property
    def end(self) -> int:
        """The pulse after the last known one; 0 if there is none."""
        ends = [
            playlist.index.all[-1].end
            for playlist in (*self.cameras.values(), self.audio)
            if playlist.index.all
        ]
        return max([*ends, *(segment.first for segment in self.segments[-1:])], default=0)

    def set_written_times(self, now: float) -> None:
        """Set when segments were written from the age clock at their pulses, but not later than ``now``."""
        ends = [*(segment.first for segment in self.segments[1:]), self.end]
        for segment, end in zip(self.segments, ends, strict=True):
            segment.written = min(now, self.info.age_clock_at_pulse0 + end / self.info.fps)

    @property
    def age_clock_at_start(self) -> float:
        """The age clock at the beginning of the oldest segment that is left."""
        first = self.segments[0].first if self.segments else self.end
        return self.info.age_clock_at_pulse0 + first / self.info.fps

    def make_younger(self, seconds: float) -> None:
        """Move the session's times forward by so many seconds of the age clock, if writing succeeds."""
        for segment in self.segments:
            segment.written += seconds
        with contextlib.suppress(OSError):
            self.set_age_clock(self.info.age_clock, self.info.age_clock_at_pulse0 + seconds)

    @property
    def is_in_place(self) -> bool:
        """Whether its folder is still the same one; it may be removed, or another disk be mounted."""
        return self._info_file.is_folder_in_place

    @property
    def is_loadable(self) -> bool:
        """Whether the folder is in place with its ``session.json``, so that a restart finds it."""
        return not self._info_file.is_missing

    def recount(self) -> None:
        """Recount the bytes of all segments, and forget segments without any file."""
        for segment in self.segments:
            segment.bytes = sum(file_size(path) for path in self.paths.segment_files(segment.first))
        self.segments = [
            segment
            for segment in self.segments
            if not all(map(is_missing, self.paths.segment_files(segment.first)))
        ]

    def restore_info(self) -> None:
        """Write ``session.json`` again: without it a restart would not find the session.

        Raises:
            OSError: writing fails.
        """
        self._info_file.write(self.info)

    def has_file_of(self, entry: IndexEntry) -> bool:
        """Return whether the frames of an index entry are on the disk, as far as file sizes tell.

        Raises:
            OSError: the file cannot be read: no permission, or the disk fails.
        """
        try:
            with self.paths.camera_file(entry.camera, entry.file).open("rb") as file:
                return os.fstat(file.fileno()).st_size >= entry.offset + entry.length
        except MISSING:
            return False

    def forget_missing_entries(self) -> None:
        """Drop playlist entries whose files are not on the disk any more; any thread may call it.

        Segments stay: their files may appear again, and must then be deleted later.

        Raises:
            OSError: a folder cannot be read.
        """
        entries_of = [
            (playlist, playlist.index.all) for playlist in self.playlists
        ]  # before the disk is read
        cameras = self.paths.camera_sizes()
        audio = {AUDIO: media_sizes(self.folder / AUDIO)}
        for playlist, entries in entries_of:
            sizes = audio if playlist is self.audio else cameras
            missing = {
                (entry.camera, entry.file)
                for entry in entries
                if sizes.get(entry.camera, {}).get(entry.file, -1) < entry.offset + entry.length
            }
            playlist.drop_files(missing)

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return sum(segment.bytes for segment in self.segments) + sum(
            playlist.bytes for playlist in self.playlists
        )

    @property
    def playlists(self) -> list[RecordingPlaylist]:
        """Those of cameras, of the sound, and of people."""
        return [*self.cameras.values(), self.audio, *self.objects.values()]

    def person(self, number: int) -> RecordingPlaylist:
        """Return a person's playlist, a new one if there is none."""
        if number not in self.objects:
            path = self.folder / "objects" / f"{number}.m3u8"
            self.objects[number] = self._playlist(path, "../cameras/", f"../cameras/{INIT_FILE}")
        return self.objects[number]

    def decision_files(self, start: int, end: int) -> list[Path]:
        """Return the decision files that may cover pulses ``start … end - 1``, in order."""
        firsts = [segment.first for segment in tuple(self.segments)]
        nexts = [*firsts[1:], None][: len(firsts)]  # at first there are none
        return [
            self.paths.decision_file(first)
            for first, following in zip(firsts, nexts, strict=True)
            if first < end and (following is None or following > start)
        ]

    def delete(self, segments: Collection[RecordingSegment]) -> None:
        """Delete segments: from memory, then their files, then from the playlists on the disk.

        Only the last step takes space, so that a full disk has some by then. A segment with a file that
        cannot be deleted stays, and is marked as stuck.

        Raises:
            OSError: a file cannot be deleted.
        """
        firsts = {segment.first for segment in segments}
        for playlist in self.playlists:
            playlist.drop_segments(firsts)
        stuck: set[int] = set()
        failed: OSError | None = None
        for first in sorted(firsts):
            try:
                for path in self.paths.segment_files(first):
                    with contextlib.suppress(*MISSING):
                        path.unlink()
            except OSError as error:
                stuck.add(first)
                failed = error
        self.segments = [
            segment for segment in self.segments if segment.first not in firsts or segment.first in stuck
        ]
        for segment in self.segments:
            segment.is_stuck = segment.first in stuck or segment.is_stuck
        self.rewrite_stale_playlists()
        if failed is not None:
            raise failed

    def rewrite_stale_playlists(self) -> None:
        """Rewrite the stale playlists; one that cannot be written stays stale."""
        for playlist in self.playlists:
            if playlist.is_stale:
                with contextlib.suppress(OSError):
                    playlist.rewrite()
        self.objects = {
            number: playlist
            for number, playlist in self.objects.items()
            if playlist.index.all or playlist.is_stale
        }

    def remove_files(self) -> None:
        """Remove the session's files, and its folder if nothing else is in it; only if it is in place."""
        if self.is_in_place:
            remove_session_files(self.folder)

    def _playlist(
        self, path: Path, cameras_folder: str = "", init_path: str = INIT_FILE
    ) -> RecordingPlaylist:
        info = self.info
        return RecordingPlaylist(path, cameras_folder, init_path, info.fps, info.pulse0, self._longest_s)
