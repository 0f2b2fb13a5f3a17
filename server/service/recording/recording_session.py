"""One run of the service on the disk: the cameras' files, everybody's playlists, and who was where.

Pulses and people's numbers may begin anew when a service does; so every run has a folder of its own.

====================================  ====================================================================
``RUN/run.json``                      :class:`SessionInfo`
``RUN/cameras/init.mp4``              what a player needs before the first fragment, the same for all
``RUN/cameras/c0/000000001250.mp4``   a camera's frames from pulse 1250 on
``RUN/cameras/c0.m3u8``               all of that camera
``RUN/sound/000000001250.mp4``        the site's sound from pulse 1250 on, and ``init.mp4``, likewise
``RUN/sound.m3u8``                    all of it
``RUN/objects/3.m3u8``                the best view of object 3
``RUN/index/000000001250.jsonl``      a line per GOP from pulse 1250 on: choices, boxes, cuts
====================================  ====================================================================
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec

from server.service.recording.audio_file import AUDIO_NAME as SOUND
from server.service.recording.playlist_file import CAMERA_PATTERN, RecordingPlaylist, file_name
from server.service.recording.segment_index import IndexEntry
from server.service.recording.session_files import (
    MISSING,
    file_size,
    identity_of,
    is_missing,
    media_sizes,
    remove_session_files,
)
from server.system.private_files import FOLDER, write_private

INFO_FILE = "run.json"
_HEADER = "init.mp4"


_LONGEST_S = 1e12
"""Beyond what any clock has counted: what says more was damaged."""

CameraName = Annotated[str, msgspec.Meta(pattern=rf"^{CAMERA_PATTERN}\Z")]
"""A camera's name is part of files' names: what was damaged leads nowhere else."""


class SessionInfo(msgspec.Struct, frozen=True, kw_only=True):
    """What holds for a whole run."""

    site: str
    fps: Annotated[float, msgspec.Meta(ge=0.001, le=1000)]
    width: int
    height: int
    codec: str
    cameras: list[CameraName]
    sound: str | None = None
    """The codec of the sound; null: the site had none."""
    began: float
    """When the first GOP was written, unix seconds."""
    pulse0: float | None
    """When pulse 0 was due, unix seconds; null where it is not known."""
    numbers_since: float | None = None
    """When people's numbers began, unix seconds: in runs of the same time they are the same people's."""
    clock: str = ""
    """The id of the recording's own clock (:mod:`recording_age`), by which it gets old."""
    clock0: Annotated[float, msgspec.Meta(ge=-_LONGEST_S, le=_LONGEST_S)] = 0.0
    """What that said at pulse 0."""


@dataclass(frozen=True, slots=True)
class InitSegments:
    """What the files of a run begin with: ``ftyp`` and ``moov``."""

    pictures: bytes
    sound: bytes = b""
    """Nothing where the site has no sound."""


@dataclass(slots=True)
class RecordingSegment:
    """The files that begin with one pulse: one per camera, that of the sound, and their index."""

    first: int
    bytes: int
    written: float
    """When something was last added, by the recording's own clock."""
    is_stuck: bool = False
    """Some of its files could not be taken away when they should have been."""


class RecordingSession:
    """The folder of one run, this service's or an earlier one's. ``longest_s``: of a segment."""

    def __init__(self, folder: Path, head: SessionInfo, headers: InitSegments, longest_s: float) -> None:
        self.folder, self.head, self.headers = folder, head, headers
        self._identity = identity_of(folder)
        self._head_bytes = file_size(folder / INFO_FILE)
        self._longest_s = longest_s
        self.segments: list[RecordingSegment] = []
        self.objects: dict[int, RecordingPlaylist] = {}
        self.cameras = {
            camera: self._playlist(folder / "cameras" / f"{camera}.m3u8") for camera in head.cameras
        }
        self.sound = self._playlist(folder / f"{SOUND}.m3u8", header=f"{SOUND}/{_HEADER}")

    @classmethod
    def begin(
        cls, folder: Path, head: SessionInfo, headers: InitSegments, longest_s: float
    ) -> RecordingSession:
        """Make the folder of a new run.

        Raises:
            OSError: it cannot be made.
        """
        folder.mkdir(mode=FOLDER)  # the one around it is the store's to make: it may have been removed
        for part in ("cameras", "objects", "index"):
            (folder / part).mkdir(mode=FOLDER)
        write_private(folder / "cameras" / _HEADER, headers.pictures)
        if headers.sound:
            (folder / SOUND).mkdir(mode=FOLDER)
            write_private(folder / SOUND / _HEADER, headers.sound)
        write_private(folder / INFO_FILE, _text(head))
        return cls(folder, head, headers, longest_s)

    def number_since(self, since: float | None) -> None:
        """Note when people's numbers began: when the first camera came, maybe after the first GOP.

        Raises:
            OSError: the disk does not take it.
        """
        self._write_head(msgspec.structs.replace(self.head, numbers_since=since))

    def date(self, clock: str, clock0: float) -> None:
        """Note what the recording's clock of this id said at pulse 0.

        Raises:
            OSError: the disk does not take it.
        """
        self.head = msgspec.structs.replace(self.head, clock=clock, clock0=clock0)
        self._write_head(self.head)

    def _write_head(self, head: SessionInfo) -> None:
        draft = self.folder / f".{INFO_FILE}"
        try:
            write_private(draft, _text(head))
            draft.replace(self.folder / INFO_FILE)
        except OSError:
            with contextlib.suppress(OSError):
                draft.unlink(missing_ok=True)
            raise
        self.head, self._head_bytes = head, len(_text(head))

    @classmethod
    def found(cls, folder: Path, longest_s: float) -> RecordingSession:
        """Take over what an earlier service left.

        Raises:
            OSError, msgspec.DecodeError: it is no such folder.
        """
        head = msgspec.json.decode((folder / INFO_FILE).read_bytes(), type=SessionInfo)
        headers = InitSegments(_read(folder / "cameras" / _HEADER), _read(folder / SOUND / _HEADER))
        run = cls(folder, head, headers, longest_s)
        for playlist in (*run.cameras.values(), run.sound):
            if playlist.path.exists():
                playlist.read()
        for path in sorted((folder / "objects").glob("*.m3u8")):
            if path.stem.isdecimal():
                run.object(int(path.stem)).read()
        run.segments = [RecordingSegment(first, 0, 0.0) for first in sorted(run._firsts)]
        run.recount()
        firsts = {segment.first for segment in run.segments}
        for playlist in run._playlists:  # the files may be gone, and the playlist not written since
            playlist.drop({it.file for it in playlist.tape.all} - firsts)
        with contextlib.suppress(OSError):  # what a process that was killed had begun
            for draft in (*folder.rglob("*.new"), folder / f".{INFO_FILE}"):
                draft.unlink(missing_ok=True)
        return run

    @property
    def _firsts(self) -> set[int]:
        """The first pulses that files of pictures, sound and choices are named by."""
        media = (*self.folder.glob("cameras/*/*.mp4"), *self.folder.glob(f"{SOUND}/*.mp4"))
        names = [it.stem for it in (*media, *self.folder.glob("index/*.jsonl"))]
        return {int(it) for it in names if it.isdecimal()}

    @property
    def end(self) -> int:
        """The pulse after the last that is known of; 0 where nothing is."""
        ends = [it.tape.all[-1].end for it in (*self.cameras.values(), self.sound) if it.tape.all]
        return max([*ends, *(it.first for it in self.segments[-1:])], default=0)

    def stamp(self, now: float) -> None:
        """Say when segments were written, by when their pulses were; nothing was after ``now``."""
        ends = [*(it.first for it in self.segments[1:]), self.end]
        for segment, end in zip(self.segments, ends, strict=True):
            segment.written = min(now, self.head.clock0 + end / self.head.fps)

    @property
    def begun(self) -> float:
        """When what is left of it begins, by the recording's own clock."""
        first = self.segments[0].first if self.segments else self.end
        return self.head.clock0 + first / self.head.fps

    def put_off(self, seconds: float) -> None:
        """Say that all of it was so much later by the recording's clock, if the disk takes that."""
        for segment in self.segments:
            segment.written += seconds
        with contextlib.suppress(OSError):
            self.date(self.head.clock, self.head.clock0 + seconds)

    @property
    def is_in_place(self) -> bool:
        """Whether its folder is the one it was: it may be removed, or its disk be another one."""
        return self._identity is not None and identity_of(self.folder) == self._identity

    @property
    def is_there(self) -> bool:
        """Whether it is in place, and whoever begins will find it."""
        try:
            return self.is_in_place and (self.folder / INFO_FILE).stat().st_size == self._head_bytes
        except MISSING:
            return False
        except OSError:
            return True  # nobody can tell

    def recount(self) -> None:
        """Say again what segments take, and let go of those of which nothing is left."""
        for segment in self.segments:
            segment.bytes = sum(file_size(it) for it in self.files(segment.first))
        self.segments = [it for it in self.segments if not all(map(is_missing, self.files(it.first)))]

    def restore_head(self) -> None:
        """Write again what holds for the whole run: without it nobody finds what is left of it.

        Raises:
            OSError: the disk does not take it.
        """
        self._write_head(self.head)

    def holds(self, stretch: IndexEntry) -> bool:
        """Tell whether a camera's frames that are referred to are on the disk, as far as lengths say.

        Raises:
            OSError: nobody can tell: it may not be read, or the disk fails.
        """
        try:
            with self.camera_file(stretch.camera, stretch.file).open("rb") as file:
                return os.fstat(file.fileno()).st_size >= stretch.offset + stretch.length
        except MISSING:
            return False

    def forget_missing(self) -> None:
        """Forget references to what is not on the disk any more; any thread may do so.

        Segments are as they were: their files may be there again, and are to be taken away some day.

        Raises:
            OSError: nobody can tell what there is.
        """
        told = [
            (it, it.tape.all) for it in self._playlists
        ]  # before the disk is asked: it may grow meanwhile
        cameras = {camera: media_sizes(self.folder / "cameras" / camera) for camera in self.head.cameras}
        sound = {SOUND: media_sizes(self.folder / SOUND)}
        for playlist, stretches in told:
            there = sound if playlist is self.sound else cameras
            gone = {
                (it.camera, it.file)
                for it in stretches
                if there.get(it.camera, {}).get(it.file, -1) < it.offset + it.length
            }
            playlist.drop_pieces(gone)

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return sum(it.bytes for it in self.segments) + sum(it.bytes for it in self._playlists)

    @property
    def _playlists(self) -> list[RecordingPlaylist]:
        return [*self.cameras.values(), self.sound, *self.objects.values()]

    def object(self, number: int) -> RecordingPlaylist:
        """Give somebody's playlist, a new one where there is none."""
        if number not in self.objects:
            path = self.folder / "objects" / f"{number}.m3u8"
            self.objects[number] = self._playlist(path, "../cameras/", f"../cameras/{_HEADER}")
        return self.objects[number]

    def camera_file(self, camera: str, first: int) -> Path:
        """Say where a camera's frames from a pulse on are."""
        return self.folder / "cameras" / camera / file_name(first)

    def sound_file(self, first: int) -> Path:
        """Say where the sound from a pulse on is."""
        return self.folder / SOUND / file_name(first)

    def index_file(self, first: int) -> Path:
        """Say where the choices from a pulse on are."""
        return (self.folder / "index" / file_name(first)).with_suffix(".jsonl")

    def index_of(self, start: int, end: int) -> list[Path]:
        """List the indexes in which something may stand about pulses ``start … end - 1``, in order."""
        firsts = [segment.first for segment in tuple(self.segments)]
        afters = [*firsts[1:], None]
        return [
            self.index_file(first)
            for first, after in zip(firsts, afters, strict=True)
            if first < end and (after is None or after > start)
        ]

    def files(self, first: int) -> list[Path]:
        """List a segment's files; of cameras that were away there is none."""
        cameras = (self.camera_file(camera, first) for camera in self.head.cameras)
        return [*cameras, self.sound_file(first), self.index_file(first)]

    def drop(self, segments: Collection[RecordingSegment]) -> None:
        """Take segments away: from what is known, from the disk, and then from the playlists' files.

        Only the last of it takes space, so that a full disk has some by then. What the disk does not let go
        of stays among the segments.

        Raises:
            OSError: a file cannot be taken away.
        """
        files = {segment.first for segment in segments}
        for playlist in self._playlists:
            playlist.drop(files)
        kept: set[int] = set()
        failed: OSError | None = None
        for first in sorted(files):
            try:
                for path in self.files(first):
                    with contextlib.suppress(*MISSING):
                        path.unlink()
            except OSError as error:
                kept.add(first)
                failed = error
        self.segments = [it for it in self.segments if it.first not in files or it.first in kept]
        for segment in self.segments:
            segment.is_stuck = segment.first in kept or segment.is_stuck
        self.tidy()
        if failed is not None:
            raise failed

    def tidy(self) -> None:
        """Write the playlists anew that need it; one that the disk does not take stays as it is, and due."""
        for playlist in self._playlists:
            if playlist.stale:
                with contextlib.suppress(OSError):
                    playlist.tidy()
        self.objects = {number: it for number, it in self.objects.items() if it.tape.all or it.stale}

    def remove(self) -> None:
        """Take away the folder if it is in place, but not what somebody else has put into it."""
        if self.is_in_place:
            remove_session_files(self.folder)

    def _playlist(self, path: Path, cameras: str = "", header: str = _HEADER) -> RecordingPlaylist:
        return RecordingPlaylist(path, cameras, header, self.head.fps, self.head.pulse0, self._longest_s)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:  # mostly since there was no sound
        return b""


def _text(head: SessionInfo) -> bytes:
    return msgspec.json.format(msgspec.json.encode(head)) + b"\n"
