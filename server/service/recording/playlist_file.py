"""A stream's playlist on the disk: references into the cameras' files (RFC 8216, HTTP Live Streaming).

It ends with EXT-X-ENDLIST at every moment, so that any player plays what is there and stops; what is added
is written over that line. The title of each entry says which pulses it is.
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
"""A camera id (:data:`server.config.sections.base.Identifier`), or the folder of the sound."""
_END = "#EXT-X-ENDLIST\n"
_ENTRY = re.compile(
    r"#EXTINF:[0-9.]+,p([0-9]{1,15})\+([0-9]{1,15})\n"
    r"#EXT-X-BYTERANGE:([0-9]{1,15})@([0-9]{1,15})\n"
    rf"(?:[^\n]*/)?({CAMERA_PATTERN})/([0-9]{{1,15}})\.mp4\n"
)
_NAME_DIGITS = 12


def file_name(pulse: int) -> str:
    """Name a camera's file by its first pulse, so that names sort as pulses do."""
    return f"{pulse:0{_NAME_DIGITS}}.mp4"


class RecordingPlaylist:
    """One stream's references, in memory and on the disk.

    ``cameras`` is the way from the playlist to the folder of the cameras, ``header`` that to what their files
    begin with; ``pulse0`` is when pulse 0 was due (unix seconds), None where nobody knows.
    """

    def __init__(
        self, path: Path, cameras: str, header: str, fps: float, pulse0: float | None, longest_s: float
    ) -> None:
        self.path = path
        self._header = header
        self._cameras = cameras
        self._fps = fps
        self._pulse0 = pulse0
        self._longest_s = longest_s
        self.tape = SegmentIndex()
        self._tail: int | None = None
        """Where the end line begins in the file; None: there is no file yet."""
        self._end: int | None = None
        self.stale = False
        """The file has more entries than it needs, or such as refer to what is gone: :meth:`tidy` is due."""

    @property
    def bytes(self) -> int:
        """Bytes on the disk, roughly."""
        return self._tail or 0

    def read(self) -> None:
        """Take over what the file says."""
        text = self.path.read_text(encoding="utf-8", errors="replace")
        self.tape = SegmentIndex(_parsed(text))
        stretches = self.tape.all
        self._end = stretches[-1].end if stretches else None

    def drop(self, files: Collection[int]) -> None:
        """Forget what is in these files; the playlist's own file is as it was, until it is tidied."""
        if files:
            self.stale |= self.tape.drop(files)

    def drop_pieces(self, gone: Collection[tuple[str, int]]) -> None:
        """Forget what is in these cameras' files, likewise; any thread may say so."""
        if gone and self.tape.drop_pieces(gone):
            self.stale = True

    def append(self, stretch: IndexEntry) -> None:
        """Add to the file, then to what is known.

        Raises:
            OSError: the disk does not take it; file and memory are as before.
        """
        entry = self._entry(stretch, self._end)
        if self._tail is not None and self._add(entry, self._tail):
            self._tail += len(entry.encode())
        else:
            self._replace(stretch)
        self.tape.add(stretch)
        self._end = stretch.end

    def tidy(self) -> None:
        """Write the file anew, with as few entries as there are stretches; none: no file.

        Raises:
            OSError: the disk does not take it; the file is as before.
        """
        if self.tape.all:
            self._replace()
        else:
            self.path.unlink(missing_ok=True)
            self._tail, self.stale = None, False

    def _add(self, entry: str, tail: int) -> bool:
        """Write an entry over the end line; tell whether the file is there, and is as it was left."""
        try:
            handle = os.open(self.path, os.O_WRONLY)
        except FileNotFoundError:
            return False
        try:
            if os.fstat(handle).st_size != tail + len(_END):
                return False
            write_at(handle, (entry + _END).encode(), tail)
        except OSError:
            self._tail = None  # it may be half there: written anew next time
            raise
        finally:
            os.close(handle)
        return True

    def _replace(self, *added: IndexEntry) -> None:
        self.stale = False  # before it is looked at what there is: more may be found gone meanwhile
        stretches = [*self.tape.all, *added]
        longest = max([self._longest_s, *(it.frames / self._fps for it in stretches)])
        text = (
            "#EXTM3U\n#EXT-X-VERSION:7\n"
            f"#EXT-X-TARGETDURATION:{math.ceil(longest)}\n"
            "#EXT-X-MEDIA-SEQUENCE:0\n#EXT-X-INDEPENDENT-SEGMENTS\n"
            f'#EXT-X-MAP:URI="{self._header}"\n'
        )
        end = None
        for stretch in stretches:
            text += self._entry(stretch, end)
            end = stretch.end
        draft = self.path.with_suffix(".new")
        try:
            write_private(draft, (text + _END).encode())
            draft.replace(self.path)
        except OSError:
            self.stale = True
            with contextlib.suppress(OSError):
                draft.unlink(missing_ok=True)
            raise
        self._tail = len(text.encode())

    def _entry(self, stretch: IndexEntry, end: int | None) -> str:
        hole = "" if end in (None, stretch.first) else "#EXT-X-DISCONTINUITY\n"
        date = ""
        if end != stretch.first and self._pulse0 is not None:
            with contextlib.suppress(OverflowError, ValueError, OSError):  # a damaged file's year 9999999
                moment = datetime.fromtimestamp(self._pulse0 + stretch.first / self._fps, UTC)
                date = f"#EXT-X-PROGRAM-DATE-TIME:{moment.strftime('%Y-%m-%dT%H:%M:%S.%f')[:-3]}Z\n"
        return (
            f"{hole}{date}#EXTINF:{stretch.frames / self._fps:.6f},p{stretch.first}+{stretch.frames}\n"
            f"#EXT-X-BYTERANGE:{stretch.length}@{stretch.offset}\n"
            f"{self._cameras}{stretch.camera}/{file_name(stretch.file)}\n"
        )


def _parsed(text: str) -> Iterable[IndexEntry]:
    for found in _ENTRY.finditer(text):
        first, frames, length, offset, camera, file = found.groups()
        yield IndexEntry(camera, int(file), int(offset), int(length), int(first), int(frames))
