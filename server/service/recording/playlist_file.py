"""The HLS playlist of one recorded stream on the disk: references into the cameras' files (RFC 8216).

It always ends with EXT-X-ENDLIST, so that any player plays it to the end; new entries are written over that
line. The title of each entry names its pulses.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
from collections.abc import Collection, Iterable
from datetime import UTC, datetime
from pathlib import Path

from server.service.recording.media_files import write_at
from server.service.recording.segment_index import IndexEntry, SegmentIndex
from server.system.private_files import write_private

CAMERA_PATTERN = "[A-Za-z0-9][A-Za-z0-9_-]{0,31}"
"""A camera id (:data:`server.config.sections.base.Identifier`), or the folder of the audio."""
_END = "#EXT-X-ENDLIST\n"
_ENTRY = re.compile(
    r"#EXTINF:[0-9.]+,p([0-9]{1,15})\+([0-9]{1,15})\n"
    r"#EXT-X-BYTERANGE:([0-9]{1,15})@([0-9]{1,15})\n"
    rf"(?:[^\n]*/)?({CAMERA_PATTERN})/([0-9]{{1,15}})\.mp4\n"
)
_NAME_DIGITS = 12


def file_name(pulse: int) -> str:
    """Return the name of a media file by its first pulse; names sort as pulses do."""
    return f"{pulse:0{_NAME_DIGITS}}.mp4"


class RecordingPlaylist:
    """One stream's playlist, in memory (``index``) and on the disk.

    ``cameras_folder`` is the relative path to the folder of the cameras, ``init_path`` that to their init
    segment; ``pulse0`` is when pulse 0 was due (unix seconds), None if not known.
    """

    def __init__(
        self,
        path: Path,
        cameras_folder: str,
        init_path: str,
        fps: float,
        pulse0: float | None,
        longest_segment_s: float,
    ) -> None:
        self.path = path
        self._init_path = init_path
        self._cameras_folder = cameras_folder
        self._fps = fps
        self._pulse0 = pulse0
        self._longest_s = longest_segment_s
        self.index = SegmentIndex()
        self._tail: int | None = None
        """Where EXT-X-ENDLIST begins in the file; None: the file must be rewritten."""
        self._end: int | None = None
        self.is_stale = False
        """Whether the file needs :meth:`rewrite`: entries can be joined, or refer to deleted files."""

    @property
    def bytes(self) -> int:
        """Bytes on the disk, roughly."""
        return self._tail or 0

    def read(self) -> None:
        """Read the index from the file."""
        text = self.path.read_text(encoding="utf-8", errors="replace")
        self.index = SegmentIndex(_parse(text))
        entries = self.index.all
        self._end = entries[-1].end if entries else None

    def drop_segments(self, segments: Collection[int]) -> None:
        """Drop the entries of segments, by first pulse; the file on the disk becomes stale."""
        if segments:
            self.is_stale |= self.index.drop_segments(segments)

    def drop_files(self, missing: Collection[tuple[str, int]]) -> None:
        """Drop the entries of files, by camera and first pulse, likewise; any thread may call it."""
        if missing and self.index.drop_files(missing):
            self.is_stale = True

    def append(self, entry: IndexEntry) -> None:
        """Add an entry to the file, then to the index.

        Raises:
            OSError: writing fails; file and memory are unchanged.
        """
        lines = self._lines_of(entry, self._end)
        if self._tail is not None and self._append_to_file(lines, self._tail):
            self._tail += len(lines.encode())
        else:
            self._write_all(entry)
        self.index.add(entry)
        self._end = entry.end

    def rewrite(self) -> None:
        """Rewrite the file from the index, with joined entries; remove it if there are none.

        Raises:
            OSError: writing fails; the file is unchanged.
        """
        if self.index.all:
            self._write_all()
        else:
            self.path.unlink(missing_ok=True)
            self._tail, self.is_stale = None, False

    def _append_to_file(self, lines: str, tail: int) -> bool:
        """Write an entry over the end line; return False if the file is missing or was changed."""
        try:
            handle = os.open(self.path, os.O_WRONLY)
        except FileNotFoundError:
            return False
        try:
            if os.fstat(handle).st_size != tail + len(_END):
                return False
            write_at(handle, (lines + _END).encode(), tail)
        except OSError:
            self._tail = None  # it may be written in part: it is rewritten next time
            raise
        finally:
            os.close(handle)
        return True

    def _write_all(self, *added: IndexEntry) -> None:
        self.is_stale = False  # before the index is read: another thread may drop entries meanwhile
        entries = [*self.index.all, *added]
        longest = max([self._longest_s, *(entry.frames / self._fps for entry in entries)])
        text = (
            "#EXTM3U\n#EXT-X-VERSION:7\n"
            f"#EXT-X-TARGETDURATION:{math.ceil(longest)}\n"
            "#EXT-X-MEDIA-SEQUENCE:0\n#EXT-X-INDEPENDENT-SEGMENTS\n"
            f'#EXT-X-MAP:URI="{self._init_path}"\n'
        )
        end = None
        for entry in entries:
            text += self._lines_of(entry, end)
            end = entry.end
        draft = self.path.with_suffix(".new")
        try:
            write_private(draft, (text + _END).encode())
            draft.replace(self.path)
        except OSError:
            self.is_stale = True
            with contextlib.suppress(OSError):
                draft.unlink(missing_ok=True)
            raise
        self._tail = len(text.encode())

    def _lines_of(self, entry: IndexEntry, end: int | None) -> str:
        gap = "" if end in (None, entry.first) else "#EXT-X-DISCONTINUITY\n"
        date = ""
        if end != entry.first and self._pulse0 is not None:
            with contextlib.suppress(
                OverflowError, ValueError, OSError
            ):  # the year 9999999 of a damaged file
                moment = datetime.fromtimestamp(self._pulse0 + entry.first / self._fps, UTC)
                date = f"#EXT-X-PROGRAM-DATE-TIME:{moment.strftime('%Y-%m-%dT%H:%M:%S.%f')[:-3]}Z\n"
        return (
            f"{gap}{date}#EXTINF:{entry.frames / self._fps:.6f},p{entry.first}+{entry.frames}\n"
            f"#EXT-X-BYTERANGE:{entry.length}@{entry.offset}\n"
            f"{self._cameras_folder}{entry.camera}/{file_name(entry.file)}\n"
        )


def _parse(text: str) -> Iterable[IndexEntry]:
    for match in _ENTRY.finditer(text):
        first, frames, length, offset, camera, file = match.groups()
        yield IndexEntry(camera, int(file), int(offset), int(length), int(first), int(frames))
