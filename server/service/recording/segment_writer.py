"""The segment that grows: a file per camera, the sound and the index beside them, and what refers to them."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Mapping
from pathlib import Path

import msgspec

from server.media.audio.audio_chunk import AudioChunk
from server.messaging.messages import GopChoices
from server.service.recording.audio_file import AUDIO_NAME as SOUND
from server.service.recording.media_files import MediaFile, RecordedGop, is_same_file, write_at
from server.service.recording.playlist_file import RecordingPlaylist
from server.service.recording.recording_session import InitSegments, RecordingSegment, RecordingSession
from server.service.recording.segment_index import IndexEntry
from server.system.private_files import open_private


class SegmentWriter:
    """Takes GOP after GOP. Pictures and sound are written once, however many people they go with.

    Raises:
        OSError: the disk does not take it; what was written before still plays.
    """

    def __init__(self, run: RecordingSession, segment: RecordingSegment, headers: InitSegments) -> None:
        self.segment = segment
        self._run, self._headers = run, headers
        self._files: dict[Path, MediaFile] = {}
        self._grown: dict[str, RecordingPlaylist] = {}
        self._index_path = run.index_file(segment.first)
        self._index = open_private(self._index_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        self._index_bytes = 0

    @property
    def grown(self) -> list[RecordingPlaylist]:
        """The playlists that refer to this segment."""
        return list(self._grown.values())

    @property
    def is_empty(self) -> bool:
        """Whether nothing is in it that could be found again."""
        return not self._index_bytes and all(file.is_empty for file in self._files.values())

    def write(
        self, choices: GopChoices, cameras: Mapping[str, RecordedGop], heard: AudioChunk | None, now: float
    ) -> None:
        """Write a GOP: pictures and sound first, then what is said about them, then people's references.

        Raises:
            OSError: the disk does not take it.
        """
        self._check_that_it_is_there()
        self.segment.written = now
        if heard is not None and heard.frames:
            self._write_sound(heard, choices)
        whole: dict[str, IndexEntry] = {}
        for camera, gop in cameras.items():
            stretch = self._write_camera(camera, gop)
            self._refer(self._run.cameras[camera], stretch)
            if stretch.frames == choices.frames:
                whole[camera] = stretch
        self._write_index(msgspec.json.encode(choices) + b"\n")
        for number, camera in choices.choices.items():
            if camera in whole:
                self._refer(self._run.object(number), whole[camera])

    def close(self) -> None:
        """Close the files; nothing stays of a segment that is empty.

        Raises:
            OSError: the disk did not take all of it; they are closed all the same.
        """
        with contextlib.ExitStack() as closing:
            if self.is_empty:
                closing.callback(self._remove_index)
            closing.callback(os.close, self._index)
            for file in self._files.values():
                closing.callback(file.close)

    def _remove_index(self) -> None:
        with contextlib.suppress(OSError):  # its folder may be gone, or closed
            self._index_path.unlink(missing_ok=True)

    def _check_that_it_is_there(self) -> None:
        """See that the files were not removed under our hands: what is written to them would be lost."""
        paths = [path for path, file in self._files.items() if not file.is_there]
        if not is_same_file(self._index, self._index_path):
            paths.append(self._index_path)
        if paths:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(paths[0]))

    def _write_camera(self, camera: str, gop: RecordedGop) -> IndexEntry:
        path = self._run.camera_file(camera, self.segment.first)
        offset, length = self._append(path, self._headers.pictures, gop)
        return IndexEntry(camera, self.segment.first, offset, length, gop.first, len(gop.fragments))

    def _write_sound(self, heard: AudioChunk, choices: GopChoices) -> None:
        """Write the sound of a GOP, which is referred to as if it were as long as the GOP."""
        path = self._run.sound_file(self.segment.first)
        gop = RecordedGop(choices.first, (heard.fragment,))
        offset, length = self._append(path, self._headers.sound, gop)
        stretch = IndexEntry(SOUND, self.segment.first, offset, length, choices.first, choices.frames)
        self._refer(self._run.sound, stretch)

    def _append(self, path: Path, header: bytes, gop: RecordedGop) -> tuple[int, int]:
        """Append to a file, which begins with the header; give where it is: offset and length."""
        file = self._files.get(path)
        if file is None:
            file = self._files[path] = MediaFile(path, header)
            self.segment.bytes += file.size
        place = file.append(gop)
        self.segment.bytes += place[1]
        return place

    def _write_index(self, line: bytes) -> None:
        try:
            write_at(self._index, line, self._index_bytes)
        except OSError:
            os.ftruncate(self._index, self._index_bytes)
            raise
        self._index_bytes += len(line)
        self.segment.bytes += len(line)

    def _refer(self, playlist: RecordingPlaylist, stretch: IndexEntry) -> None:
        playlist.append(stretch)
        self._grown[str(playlist.path)] = playlist
