"""The segment that grows: a file per camera, the index beside them, and the playlists that refer to them."""

from __future__ import annotations

import os
from collections.abc import Mapping

import msgspec

from server.view.past.media import CameraFile, Gop, write_at
from server.view.past.playlist import Playlist
from server.view.past.run import Run, Segment
from server.view.past.stretch import Stretch
from server.wire.messages import GopChoices


class OpenSegment:
    """Takes GOP after GOP. The cameras' bytes are written once, however many people they show.

    Raises:
        OSError: the disk does not take it; what was written before still plays.
    """

    def __init__(self, run: Run, segment: Segment, header: bytes) -> None:
        self.segment = segment
        self._run, self._header = run, header
        self._files: dict[str, CameraFile] = {}
        self._grown: dict[str, Playlist] = {}
        path = run.index_file(segment.first)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._index = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        self._index_bytes = 0

    @property
    def grown(self) -> list[Playlist]:
        """The playlists that refer to this segment."""
        return list(self._grown.values())

    def write(self, choices: GopChoices, cameras: Mapping[str, Gop], now: float) -> None:
        """Write a GOP: pictures first, then what is said about them, then the references.

        Raises:
            OSError: the disk does not take it.
        """
        self.segment.written = now
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
        file = self._files.get(camera)
        if file is None:
            path = self._run.camera_file(camera, self.segment.first)
            file = self._files[camera] = CameraFile(path, self._header)
            self.segment.bytes += file.size
        offset, length = file.append(gop)
        self.segment.bytes += length
        return Stretch(camera, self.segment.first, offset, length, gop.first, len(gop.fragments))

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
