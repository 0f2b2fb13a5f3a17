"""One run of the service on the disk: the cameras' files, everybody's playlists, and who was where.

Pulses and people's numbers may begin anew when a service does; so every run has a folder of its own.

====================================  ====================================================================
``RUN/run.json``                      :class:`RunHead`
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
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec

from server.view.past.playlist import CAMERA, Playlist, file_name
from server.view.past.sounds import NAME as SOUND

HEAD = "run.json"
_HEADER = "init.mp4"


Camera = Annotated[str, msgspec.Meta(pattern=rf"^{CAMERA}\Z")]
"""A camera's name is part of files' names: what was damaged leads nowhere else."""


class RunHead(msgspec.Struct, frozen=True, kw_only=True):
    """What holds for a whole run."""

    site: str
    fps: Annotated[float, msgspec.Meta(ge=0.001, le=1000)]
    width: int
    height: int
    codec: str
    cameras: list[Camera]
    sound: str | None = None
    """The codec of the sound; null: the site had none."""
    began: float
    """When the first GOP was written, unix seconds."""
    pulse0: float | None
    """When pulse 0 was due, unix seconds; null where it is not known."""
    numbers_since: float | None = None
    """When people's numbers began, unix seconds: in runs of the same time they are the same people's."""


@dataclass(frozen=True, slots=True)
class Headers:
    """What the files of a run begin with: ``ftyp`` and ``moov``."""

    pictures: bytes
    sound: bytes = b""
    """Nothing where the site has no sound."""


@dataclass(slots=True)
class Segment:
    """The files that begin with one pulse: one per camera, that of the sound, and their index."""

    first: int
    bytes: int
    written: float
    """When something was last added, unix seconds."""


class Run:
    """The folder of one run, this service's or an earlier one's. ``longest_s``: of a segment."""

    def __init__(self, folder: Path, head: RunHead, headers: Headers, longest_s: float) -> None:
        self.folder, self.head, self.headers = folder, head, headers
        self._longest_s = longest_s
        self.segments: list[Segment] = []
        self.objects: dict[int, Playlist] = {}
        self.cameras = {
            camera: self._playlist(folder / "cameras" / f"{camera}.m3u8") for camera in head.cameras
        }
        self.sound = self._playlist(folder / f"{SOUND}.m3u8", header=f"{SOUND}/{_HEADER}")

    @classmethod
    def begin(cls, folder: Path, head: RunHead, headers: Headers, longest_s: float) -> Run:
        """Make the folder of a new run.

        Raises:
            OSError: it cannot be made.
        """
        for part in ("cameras", "objects", "index"):
            (folder / part).mkdir(parents=True, exist_ok=True)
        (folder / "cameras" / _HEADER).write_bytes(headers.pictures)
        if headers.sound:
            (folder / SOUND).mkdir(exist_ok=True)
            (folder / SOUND / _HEADER).write_bytes(headers.sound)
        (folder / HEAD).write_bytes(_text(head))
        return cls(folder, head, headers, longest_s)

    def number_since(self, since: float | None) -> None:
        """Note when people's numbers began: when the first camera came, maybe after the first GOP.

        Raises:
            OSError: the disk does not take it.
        """
        head = msgspec.structs.replace(self.head, numbers_since=since)
        draft = self.folder / f".{HEAD}"
        draft.write_bytes(_text(head))
        draft.replace(self.folder / HEAD)
        self.head = head

    @classmethod
    def found(cls, folder: Path, longest_s: float) -> Run:
        """Take over what an earlier service left.

        Raises:
            OSError, msgspec.DecodeError: it is no such folder.
        """
        head = msgspec.json.decode((folder / HEAD).read_bytes(), type=RunHead)
        headers = Headers(_read(folder / "cameras" / _HEADER), _read(folder / SOUND / _HEADER))
        run = cls(folder, head, headers, longest_s)
        for playlist in (*run.cameras.values(), run.sound):
            if playlist.path.exists():
                playlist.read()
        for path in sorted((folder / "objects").glob("*.m3u8")):
            if path.stem.isdecimal():
                run.object(int(path.stem)).read()
        for path in sorted((folder / "index").glob("*.jsonl")):
            if path.stem.isdecimal():
                first = int(path.stem)
                size = sum(it.stat().st_size for it in run.files(first) if it.exists())
                run.segments.append(Segment(first, size, path.stat().st_mtime))
        firsts = {segment.first for segment in run.segments}
        for playlist in run._playlists:  # the files may be gone, and the playlist not written since
            playlist.drop({it.file for it in playlist.tape.all} - firsts)
        return run

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return sum(it.bytes for it in self.segments) + sum(it.bytes for it in self._playlists)

    @property
    def _playlists(self) -> list[Playlist]:
        return [*self.cameras.values(), self.sound, *self.objects.values()]

    def object(self, number: int) -> Playlist:
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

    def drop(self, segments: Collection[Segment]) -> None:
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
                    path.unlink(missing_ok=True)
            except OSError as error:
                kept.add(first)
                failed = error
        self.segments = [it for it in self.segments if it.first not in files or it.first in kept]
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

    def _playlist(self, path: Path, cameras: str = "", header: str = _HEADER) -> Playlist:
        return Playlist(path, cameras, header, self.head.fps, self.head.pulse0, self._longest_s)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:  # mostly since there was no sound
        return b""


def _text(head: RunHead) -> bytes:
    return msgspec.json.format(msgspec.json.encode(head)) + b"\n"
