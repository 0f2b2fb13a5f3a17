"""Writes the segment in progress: a file per camera, the audio, the decisions, and the playlists' entries."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Mapping
from pathlib import Path

import msgspec

from server.media.audio.audio_chunk import AudioChunk
from server.messaging.messages import GopChoices
from server.service.recording.media_files import MediaFile, RecordedGop, is_same_file, write_at
from server.service.recording.playlist_file import RecordingPlaylist
from server.service.recording.recording_session import RecordingSegment, RecordingSession
from server.service.recording.segment_index import IndexEntry
from server.service.recording.session_files import AUDIO, InitSegments
from server.system.private_files import open_private


class SegmentWriter:
    """Appends GOP after GOP. Video and audio are written once for all persons' playlists.

    Raises:
        OSError: writing fails; earlier data still plays.
    """

    def __init__(self, session: RecordingSession, segment: RecordingSegment, init: InitSegments) -> None:
        self.segment = segment
        self._session, self._init = session, init
        self._files: dict[Path, MediaFile] = {}
        self._playlists: dict[str, RecordingPlaylist] = {}
        self._index_path = session.paths.decision_file(segment.first)
        self._index = open_private(self._index_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        self._index_bytes = 0

    @property
    def playlists(self) -> list[RecordingPlaylist]:
        """The playlists that refer to this segment."""
        return list(self._playlists.values())

    @property
    def is_empty(self) -> bool:
        """Whether it contains nothing playable."""
        return not self._index_bytes and all(file.is_empty for file in self._files.values())

    def write(
        self, choices: GopChoices, cameras: Mapping[str, RecordedGop], audio: AudioChunk | None, now: float
    ) -> None:
        """Write a GOP: video and audio, then the decision, then the entries of persons' playlists.

        Raises:
            OSError: writing fails.
        """
        self._check_files_exist()
        self.segment.written = now
        if audio is not None and audio.frames:
            self._write_audio(audio, choices)
        complete: dict[str, IndexEntry] = {}
        for camera, gop in cameras.items():
            entry = self._write_camera(camera, gop)
            self._append_entry(self._session.cameras[camera], entry)
            if entry.frames == choices.frames:
                complete[camera] = entry
        self._write_index(msgspec.json.encode(choices) + b"\n")
        for number, camera in choices.choices.items():
            if camera in complete:
                self._append_entry(self._session.person(number), complete[camera])

    def close(self) -> None:
        """Close the files; an empty segment leaves none.

        Raises:
            OSError: writing fails; the files are closed nevertheless.
        """
        with contextlib.ExitStack() as closing:
            if self.is_empty:
                closing.callback(self._remove_index)
            closing.callback(os.close, self._index)
            for file in self._files.values():
                closing.callback(file.close)

    def _remove_index(self) -> None:
        with contextlib.suppress(OSError):  # its folder may be removed, or not writable
            self._index_path.unlink(missing_ok=True)

    def _check_files_exist(self) -> None:
        """Raise if an open file was removed: what is written to it would be lost."""
        paths = [path for path, file in self._files.items() if not file.exists]
        if not is_same_file(self._index, self._index_path):
            paths.append(self._index_path)
        if paths:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(paths[0]))

    def _write_camera(self, camera: str, gop: RecordedGop) -> IndexEntry:
        path = self._session.paths.camera_file(camera, self.segment.first)
        offset, length = self._append(path, self._init.video, gop)
        return IndexEntry(camera, self.segment.first, offset, length, gop.first, len(gop.fragments))

    def _write_audio(self, audio: AudioChunk, choices: GopChoices) -> None:
        """Write the audio of a GOP; its playlist entry has the GOP's duration."""
        path = self._session.paths.audio_file(self.segment.first)
        gop = RecordedGop(choices.first, (audio.fragment,))
        offset, length = self._append(path, self._init.audio, gop)
        entry = IndexEntry(AUDIO, self.segment.first, offset, length, choices.first, choices.frames)
        self._append_entry(self._session.audio, entry)

    def _append(self, path: Path, header: bytes, gop: RecordedGop) -> tuple[int, int]:
        """Append to a file, which begins with the header; return offset and length in bytes."""
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

    def _append_entry(self, playlist: RecordingPlaylist, entry: IndexEntry) -> None:
        playlist.append(entry)
        self._playlists[str(playlist.path)] = playlist
