"""The segment that grows: a file per camera, the sound and the index beside them, and what refers to them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import msgspec

from server.view.media.heard import Heard
from server.view.past.media import CameraFile, Gop, write_at
from server.view.past.playlist import Playlist
from server.view.past.run import Headers, Run, Segment
from server.view.past.sounds import NAME as SOUND
from server.view.past.stretch import Stretch
from server.wire.messages import GopChoices


class OpenSegment:
    """Takes GOP after GOP. Pictures and sound are written once, however many people they go with.

    Raises:
        OSError: the disk does not take it; what was written before still plays.
    """

    def __init__(self, run: Run, segment: Segment, headers: Headers) -> None:
        self.segment = segment
        self._run, self._headers = run, headers
        self._files: dict[Path, CameraFile] = {}
        self._grown: dict[str, Playlist] = {}
        path = run.index_file(segment.first)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._index = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        self._index_bytes = 0

    @property
    def grown(self) -> list[Playlist]:
        """The playlists that refer to this segment."""
        return list(self._grown.values())

    def write(self, choices: GopChoices, cameras: Mapping[str, Gop], heard: Heard | None, now: float) -> None:
        """Write a GOP: pictures and sound first, then what is said about them, then people's references.

        Raises:
            OSError: the disk does not take it.
        """
        self.segment.written = now
        if heard is not None and heard.frames:
            self._write_sound(heard, choices)
        whole: dict[str, Stretch] = {}
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
        """Close the files."""
        for file in self._files.values():
            file.close()
        os.close(self._index)

    def _write_camera(self, camera: str, gop: Gop) -> Stretch:
        path = self._run.camera_file(camera, self.segment.first)
        offset, length = self._append(path, self._headers.pictures, gop)
        return Stretch(camera, self.segment.first, offset, length, gop.first, len(gop.fragments))

    def _write_sound(self, heard: Heard, choices: GopChoices) -> None:
        """Write the sound of a GOP, which is referred to as if it were as long as the GOP."""
        path = self._run.sound_file(self.segment.first)
        gop = Gop(choices.first, (heard.fragment,))
        offset, length = self._append(path, self._headers.sound, gop)
        stretch = Stretch(SOUND, self.segment.first, offset, length, choices.first, choices.frames)
        self._refer(self._run.sound, stretch)

    def _append(self, path: Path, header: bytes, gop: Gop) -> tuple[int, int]:
        """Append to a file, which begins with the header; give where it is: offset and length."""
        file = self._files.get(path)
        if file is None:
            file = self._files[path] = CameraFile(path, header)
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

    def _refer(self, playlist: Playlist, stretch: Stretch) -> None:
        playlist.append(stretch)
        self._grown[str(playlist.path)] = playlist
