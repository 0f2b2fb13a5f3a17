"""The cameras' files: whole GOPs as fragments behind one header, written and found again."""

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

Given = ParamSpec("Given")
Read = TypeVar("Read")

_AT_ONCE = 8
_THREADS = ThreadPoolExecutor(_AT_ONCE, "past")


async def run_in_reader_thread(
    read: Callable[Given, Read], *args: Given.args, **kwargs: Given.kwargs
) -> Read:
    """Read something in one of these threads."""
    return await asyncio.get_running_loop().run_in_executor(_THREADS, partial(read, *args, **kwargs))


_HEAD = 8
"""Bytes of a box's size and kind."""
_TIMES_WITHIN = 128
"""Bytes of a fragment in which its decode time and its first sample's flags stand."""
_NOT_SYNC = 0x00010000
"""sample_is_non_sync_sample (ISO/IEC 14496-12, 8.8.3.1)."""


@dataclass(frozen=True, slots=True)
class RecordedGop:
    """Consecutive frames of one camera that begin with a key frame."""

    first: int
    fragments: tuple[bytes, ...]

    @property
    def end(self) -> int:
        """The pulse after its last frame."""
        return self.first + len(self.fragments)

    @property
    def data(self) -> bytes:
        """Its bytes."""
        return b"".join(self.fragments)


def pictures_of_gop(gop: RecordedGop, agreement: StreamFormat) -> list[EncodedPicture]:
    """Give a GOP's pictures as the site's streams have them."""
    told = agreement.told_by(gop.fragments[0])
    return [
        EncodedPicture(gop.first + place, is_key(fragment), fragment, boot=0, parameters=told)
        for place, fragment in enumerate(gop.fragments)
    ]


class MediaFile:
    """One camera's file: the header, then GOPs.

    A process that is killed in the middle of a GOP leaves a file that plays: until a GOP is there as a
    whole, it is a ``free`` box, which players pass over, and eight bytes at once make it what it is. The
    file itself is there from its first GOP on: a header alone does not play.

    Raises:
        OSError: the disk does not take it.
    """

    def __init__(self, path: Path, header: bytes) -> None:
        path.parent.mkdir(mode=FOLDER, exist_ok=True)  # that of the run is there, or was removed
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
        """Append a GOP; give where it is: offset and length.

        Raises:
            OSError: the disk does not take it; the file is as before.
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
        """Whether there is no GOP in it yet."""
        return self._is_empty

    @property
    def is_there(self) -> bool:
        """Whether it is still where it was made: what is written to a file that was removed is lost."""
        return is_same_file(self._handle, self._draft if self._is_empty else self._path)

    def close(self) -> None:
        """Close the file; without a GOP there is none."""
        try:
            os.close(self._handle)
        finally:
            if self._is_empty:
                with contextlib.suppress(OSError):  # its folder may be gone, or closed
                    self._draft.unlink(missing_ok=True)


def is_same_file(handle: int, path: Path) -> bool:
    """Tell whether an open file is what a path leads to: it may have been removed, or be on another disk."""
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except (FileNotFoundError, NotADirectoryError):
        return False


def write_at(handle: int, data: bytes, offset: int) -> None:
    """Write all of it.

    Raises:
        OSError: the disk does not take it; part of it may be there.
    """
    view = memoryview(data)
    while view:
        written = os.pwrite(handle, view, offset)
        view, offset = view[written:], offset + written


def pulse_of(fragment: bytes, fps: float) -> int:
    """Give the pulse of a fragment's first frame; -1 where it does not say."""
    at = fragment.find(b"tfdt", 0, _TIMES_WITHIN)
    if at < 0 or len(fragment) < at + 16:
        return -1
    time: int = struct.unpack_from(">Q", fragment, at + 8)[0]
    return round(time * fps / TIMESCALE)


def read_gops(
    path: Path, offset: int, length: int, fps: float, pulse: int = 0
) -> Generator[RecordedGop, None, None]:
    """Read the GOPs of a piece of a camera's file, from the one that holds a pulse on.

    Raises:
        OSError: the file cannot be read: retention may have taken it away.
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
    """Say where the last key frame up to a pulse is in a piece of a file; pictures are passed over."""
    found, at = offset, offset
    while at + _HEAD <= offset + length:
        file.seek(at)
        start = file.read(_TIMES_WITHIN)
        if len(start) < _HEAD:
            break
        size, kind = struct.unpack_from(">I4s", start)
        if kind == b"moof":
            if pulse_of(start, fps) > pulse:
                break
            found = at if is_key(start) else found
        at += max(_HEAD, size)
    return found


def is_key(fragment: bytes) -> bool:
    """Tell whether a fragment begins with a key frame."""
    at = fragment.find(b"trun", 0, _TIMES_WITHIN)
    if at < 0 or len(fragment) < at + 28:
        return False
    (flags,) = struct.unpack_from(">I", fragment, at + 24)
    return not flags & _NOT_SYNC


def _fragments(read: Callable[[int], bytes], length: int) -> Iterator[bytes]:
    """Give the fragments among the boxes of the next ``length`` bytes."""
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
