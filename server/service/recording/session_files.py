"""The files of one recording session: names, layout, and what is really on the disk.

Pulses and person numbers may start again with the service, so every session has a folder of its own.

=========================================  ================================================================
``SESSION/session.json``                   :class:`RecordingSessionInfo`
``SESSION/cameras/init.mp4``               the init segment of the cameras' files
``SESSION/cameras/c0/000000001250.mp4``    a camera's frames from pulse 1250 on
``SESSION/cameras/c0.m3u8``                the playlist of that camera
``SESSION/sound/000000001250.mp4``         the site's audio from pulse 1250 on, and ``init.mp4``, likewise
``SESSION/sound.m3u8``                     the playlist of the audio
``SESSION/objects/3.m3u8``                 the best view of person 3
``SESSION/index/000000001250.jsonl``       a line per GOP from pulse 1250 on: choices, boxes, cuts
=========================================  ================================================================
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec

from server.service.recording.playlist_file import CAMERA_PATTERN, file_name
from server.system.private_files import write_private

INFO_FILE = "session.json"
INIT_FILE = "init.mp4"
AUDIO = "sound"
"""The folder of the audio, and what a reference to it has instead of a camera."""
MISSING = (FileNotFoundError, NotADirectoryError, IsADirectoryError)
"""The errors of a file that does not exist, or whose name is not that of a file."""
_MEDIA_NAME = re.compile(r"[0-9]{1,15}\.mp4")
_SESSION_NAME = re.compile(
    rf"[0-9]{{1,15}}\.(mp4|jsonl|m3u8|new)|\.?session\.json|init\.mp4|{CAMERA_PATTERN}\.(m3u8|new)"
)
"""Names of the files in a session's folder."""
_MAX_AGE_S = 1e12
"""No clock has counted this far: a larger value is damaged."""

CameraName = Annotated[str, msgspec.Meta(pattern=rf"^{CAMERA_PATTERN}\Z")]
"""Camera names are part of paths: the pattern keeps a damaged file from leading out of the folder."""


class RecordingSessionInfo(msgspec.Struct, frozen=True, kw_only=True):
    """The content of ``session.json``: what holds for a whole session."""

    site: str
    fps: Annotated[float, msgspec.Meta(ge=0.001, le=1000)]
    width: int
    height: int
    codec: str
    cameras: list[CameraName]
    sound: str | None = None
    """The codec of the audio; null: the site had none."""
    started: float
    """When the first GOP was written, unix seconds."""
    pulse0: float | None
    """When pulse 0 was due, unix seconds; null: unknown."""
    person_numbers_since: float | None = None
    """When the person numbers began, unix seconds: sessions with the same value use the same person
    numbers."""
    age_clock: str = ""
    """The id of the age clock (:mod:`~server.service.recording.age_clock`)."""
    age_clock_at_pulse0: Annotated[float, msgspec.Meta(ge=-_MAX_AGE_S, le=_MAX_AGE_S)] = 0.0
    """The seconds of the age clock at pulse 0."""


@dataclass(frozen=True, slots=True)
class InitSegments:
    """The first bytes of a session's media files: ``ftyp`` and ``moov``."""

    video: bytes
    audio: bytes = b""
    """Empty at a site without audio."""


@dataclass(frozen=True, slots=True)
class SessionPaths:
    """Where the files of a session are."""

    folder: Path
    cameras: Sequence[str]

    def camera_file(self, camera: str, first: int) -> Path:
        """Return the file of a camera's frames from a pulse on."""
        return self.folder / "cameras" / camera / file_name(first)

    def audio_file(self, first: int) -> Path:
        """Return the file of the audio from a pulse on."""
        return self.folder / AUDIO / file_name(first)

    def decision_file(self, first: int) -> Path:
        """Return the file of the decisions from a pulse on."""
        return (self.folder / "index" / file_name(first)).with_suffix(".jsonl")

    def segment_files(self, first: int) -> list[Path]:
        """Return all files of a segment; there is none of a camera that was disconnected."""
        cameras = (self.camera_file(camera, first) for camera in self.cameras)
        return [*cameras, self.audio_file(first), self.decision_file(first)]

    def segment_starts(self) -> set[int]:
        """Return the first pulses of the segments on the disk, from the names of their files."""
        media = (*self.folder.glob("cameras/*/*.mp4"), *self.folder.glob(f"{AUDIO}/*.mp4"))
        names = [path.stem for path in (*media, *self.folder.glob("index/*.jsonl"))]
        return {int(name) for name in names if name.isdecimal()}

    def camera_sizes(self) -> dict[str, dict[int, int]]:
        """Return the sizes of the cameras' files, by camera and first pulse.

        Raises:
            OSError: a folder cannot be read.
        """
        return {camera: media_sizes(self.folder / "cameras" / camera) for camera in self.cameras}

    def init_segments(self) -> InitSegments:
        """Read the init segments; empty where there is none."""
        return InitSegments(
            _read(self.folder / "cameras" / INIT_FILE), _read(self.folder / AUDIO / INIT_FILE)
        )


def remove_session_files(folder: Path) -> None:
    """Delete a session's files, and its folder if nothing else is in it; errors are ignored."""
    if folder.is_symlink():
        return
    for inside, folders, names in os.walk(folder, topdown=False):
        for name in names:
            if _SESSION_NAME.fullmatch(name):
                with contextlib.suppress(OSError):
                    Path(inside, name).unlink()
        for name in folders:
            with contextlib.suppress(OSError):
                Path(inside, name).rmdir()
    with contextlib.suppress(OSError):
        folder.rmdir()


def has_media(folder: Path) -> bool:
    """Return whether a folder with the layout of a session holds video or audio."""
    files = (*folder.glob("cameras/*/*.mp4"), *folder.glob(f"{AUDIO}/*.mp4"))
    return any(path.stem.isdecimal() for path in files)


def media_sizes(folder: Path) -> dict[int, int]:
    """Return the sizes of a folder's media files, by first pulse.

    Raises:
        OSError: the folder cannot be read.
    """
    try:
        with os.scandir(folder) as entries:
            files = [entry for entry in entries if _MEDIA_NAME.fullmatch(entry.name)]
            return {int(entry.name[:-4]): file_size(entry) for entry in files}
    except MISSING:
        return {}


def identity_of(folder: Path) -> tuple[int, int] | None:
    """Return the device and inode of a folder, which distinguish it from another of the same name."""
    try:
        status = folder.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def is_missing(path: Path) -> bool:
    """Return whether a file certainly does not exist; False if that is not known."""
    try:
        path.lstat()
    except MISSING:
        return True
    except OSError:
        return False
    return False


def file_size(file: Path | os.DirEntry[str]) -> int:
    """Return a file's size in bytes; 0 if there is none."""
    try:
        return file.stat().st_size
    except OSError:
        return 0


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:  # usually because the site had no audio
        return b""


class RecordingSessionInfoFile:
    """The ``session.json`` of a session's folder, which makes a restart find the session."""

    def __init__(self, folder: Path, info: RecordingSessionInfo) -> None:
        self.info = info
        self._folder = folder
        self._identity = identity_of(folder)
        self._bytes = file_size(folder / INFO_FILE)

    @classmethod
    def create(cls, folder: Path, info: RecordingSessionInfo) -> RecordingSessionInfoFile:
        """Write the file of a new session into its folder, which exists.

        Raises:
            OSError: writing fails.
        """
        write_private(folder / INFO_FILE, _encode(info))
        return cls(folder, info)

    @classmethod
    def load(cls, folder: Path) -> RecordingSessionInfoFile:
        """Read the file of an existing session.

        Raises:
            OSError, msgspec.DecodeError: the folder does not hold a session.
        """
        return cls(folder, msgspec.json.decode((folder / INFO_FILE).read_bytes(), type=RecordingSessionInfo))

    def write(self, info: RecordingSessionInfo) -> None:
        """Replace the file.

        Raises:
            OSError: writing fails; the file is unchanged.
        """
        draft = self._folder / f".{INFO_FILE}"
        try:
            write_private(draft, _encode(info))
            draft.replace(self._folder / INFO_FILE)
        except OSError:
            with contextlib.suppress(OSError):
                draft.unlink(missing_ok=True)
            raise
        self.info, self._bytes = info, len(_encode(info))

    @property
    def is_folder_in_place(self) -> bool:
        """Whether the folder is still the same one; it may be removed, or another disk be mounted."""
        return self._identity is not None and identity_of(self._folder) == self._identity

    @property
    def is_missing(self) -> bool:
        """Whether the file is certainly gone or replaced, or its folder is; False if that is not known."""
        try:
            return not self.is_folder_in_place or (self._folder / INFO_FILE).stat().st_size != self._bytes
        except MISSING:
            return True
        except OSError:
            return False


def _encode(info: RecordingSessionInfo) -> bytes:
    return msgspec.json.format(msgspec.json.encode(info)) + b"\n"
