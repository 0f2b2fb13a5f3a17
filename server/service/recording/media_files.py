"""Media files of the recording (fragmented MP4): appending whole GOPs, and reading them by pulse."""

from __future__ import annotations

import asyncio
import contextlib
import os
import struct
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO, ParamSpec, TypeVar

from server.media.picture import EncodedPicture
from server.media.rendering_messages import TIMESCALE
from server.media.stream_format import StreamFormat
from server.system.private_files import FOLDER, open_private

Args = ParamSpec("Args")
Read = TypeVar("Read")

_READER_THREADS = 8
_EXECUTOR = ThreadPoolExecutor(_READER_THREADS, "recording-reader")


async def run_in_reader_thread(read: Callable[Args, Read], *args: Args.args, **kwargs: Args.kwargs) -> Read:
    """Run a blocking read in one of a few threads: a disk that hangs holds up nothing but time shift."""
    return await asyncio.get_running_loop().run_in_executor(_EXECUTOR, partial(read, *args, **kwargs))


_HEAD = 8
"""Bytes of a box's size and type."""
_HEAD_LENGTH = 128
"""The first bytes of a fragment, which contain its decode time and its first sample's flags."""
_NOT_SYNC = 0x00010000
"""sample_is_non_sync_sample (ISO/IEC 14496-12, 8.8.3.1)."""


@dataclass(frozen=True, slots=True)
class RecordedGop:
    """Consecutive frames of one camera that begin with a keyframe."""

    first: int
    fragments: tuple[bytes, ...]

    @property
    def end(self) -> int:
        """The pulse after its last frame."""
        return self.first + len(self.fragments)

    @property
    def data(self) -> bytes:
        """All fragments joined."""
        return b"".join(self.fragments)


def pictures_of_gop(gop: RecordedGop, stream_format: StreamFormat) -> list[EncodedPicture]:
    """Return a GOP's pictures for the site's streams."""
    parameters, codec = stream_format.camera_parameters(gop.fragments[0]), stream_format.picture_codec
    return [
        EncodedPicture(
            gop.first + place, is_key(fragment), fragment, boot=0, parameters=parameters, codec=codec
        )
        for place, fragment in enumerate(gop.fragments)
    ]


class MediaFile:
    """A media file: the init segment, then GOPs.

    A process that is killed while it writes leaves a file that plays: until a GOP is written completely, it
    is a ``free`` box, which players skip; its first eight bytes are written last. The file appears with its
    first GOP: an init segment alone does not play.

    Raises:
        OSError: writing fails.
    """

    def __init__(self, path: Path, header: bytes) -> None:
        path.parent.mkdir(mode=FOLDER, exist_ok=True)  # not its parents: the session may have been removed
        self._path, self._draft = path, path.with_suffix(".new")
        self._handle = open_private(self._draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        self._is_empty = True
        self.size = 0
        try:
            write_at(self._handle, header, 0)
        except OSError:
            self.close()
            raise
        self.size = len(header)

    def append(self, gop: RecordedGop) -> tuple[int, int]:
        """Append a GOP; return offset and length in bytes.

        Raises:
            OSError: writing fails; the file is unchanged.
        """
        data = gop.data
        try:
            write_at(self._handle, struct.pack(">I4s", len(data), b"free") + data[_HEAD:], self.size)
            write_at(self._handle, data[:_HEAD], self.size)
        except OSError:
            os.ftruncate(self._handle, self.size)
            raise
        if self._is_empty:
            self._draft.rename(self._path)
            self._is_empty = False
        place = (self.size, len(data))
        self.size += len(data)
        return place

    @property
    def is_empty(self) -> bool:
        """Whether it has no GOP yet."""
        return self._is_empty

    @property
    def exists(self) -> bool:
        """Whether it is still at its path: what is written to a removed file is lost."""
        return is_same_file(self._handle, self._draft if self._is_empty else self._path)

    def close(self) -> None:
        """Close the file, and remove it if it has no GOP."""
        try:
            os.close(self._handle)
        finally:
            if self._is_empty:
                with contextlib.suppress(OSError):  # its folder may be removed, or not writable
                    self._draft.unlink(missing_ok=True)


def is_same_file(handle: int, path: Path) -> bool:
    """Return whether a path leads to an open file; it may have been removed or replaced."""
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except (FileNotFoundError, NotADirectoryError):
        return False


def write_at(handle: int, data: bytes, offset: int) -> None:
    """Write all of the data.

    Raises:
        OSError: writing fails; part of the data may be written.
    """
    view = memoryview(data)
    while view:
        written = os.pwrite(handle, view, offset)
        view, offset = view[written:], offset + written


def pulse_of(fragment: bytes, fps: float) -> int:
    """Return the pulse of a fragment's first frame; -1 if it has no time."""
    at = fragment.find(b"tfdt", 0, _HEAD_LENGTH)
    if at < 0 or len(fragment) < at + 16:
        return -1
    time: int = struct.unpack_from(">Q", fragment, at + 8)[0]
    return round(time * fps / TIMESCALE)


def read_gops(
    path: Path, offset: int, length: int, fps: float, pulse: int = 0
) -> Generator[RecordedGop, None, None]:
    """Yield the GOPs of a piece of a media file, from the one that holds a pulse on.

    Raises:
        OSError: the file cannot be read: retention may have deleted it.
    """
    with path.open("rb") as file:
        skipped = _last_key(file, offset, length, fps, pulse) - offset
        file.seek(offset + skipped)
        waiting: list[bytes] = []
        for fragment in _fragments(file.read, length - skipped):
            if is_key(fragment) and waiting:
                yield RecordedGop(pulse_of(waiting[0], fps), tuple(waiting))
                waiting = []
            waiting.append(fragment)
        if waiting:
            yield RecordedGop(pulse_of(waiting[0], fps), tuple(waiting))


def _last_key(file: BinaryIO, offset: int, length: int, fps: float, pulse: int) -> int:
    """Return the offset of the last keyframe up to a pulse; only the heads of fragments are read."""
    last, at = offset, offset
    while at + _HEAD <= offset + length:
        file.seek(at)
        start = file.read(_HEAD_LENGTH)
        if len(start) < _HEAD:
            break
        size, kind = struct.unpack_from(">I4s", start)
        if kind == b"moof":
            if pulse_of(start, fps) > pulse:
                break
            last = at if is_key(start) else last
        at += max(_HEAD, size)
    return last


def is_key(fragment: bytes) -> bool:
    """Return whether a fragment begins with a keyframe."""
    at = fragment.find(b"trun", 0, _HEAD_LENGTH)
    if at < 0 or len(fragment) < at + 28:
        return False
    (flags,) = struct.unpack_from(">I", fragment, at + 24)
    return not flags & _NOT_SYNC


def _fragments(read: Callable[[int], bytes], length: int) -> Iterator[bytes]:
    """Yield the fragments among the boxes of the next ``length`` bytes."""
    moof = b""
    while length >= _HEAD:
        head = read(_HEAD)
        if len(head) < _HEAD:
            return
        size, kind = struct.unpack(">I4s", head)
        if not _HEAD <= size <= length:
            return
        body = read(size - _HEAD)
        length -= size
        if kind == b"moof":
            moof = head + body
        elif kind == b"mdat" and moof:
            yield moof + head + body
