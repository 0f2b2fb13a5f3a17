"""The site's sound on the disk: a file beside the cameras', in it a fragment for each GOP.

Frames are numbered by their samples (:mod:`server.media.audio.audio_format`), which is the time that a
fragment carries: so they are found again by number, whatever was shown meanwhile.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BufferedReader
from itertools import accumulate, pairwise
from pathlib import Path

from server.media.audio.audio_format import AudioFormat

AUDIO_NAME = "sound"
"""Of the folder, and what a reference has instead of a camera."""

_HEAD = 8
"""Bytes of a box's size and kind."""


def read_audio_frames(
    path: Path, offset: int, length: int, begin: int, end: int, form: AudioFormat
) -> dict[int, bytes]:
    """Read the frames ``begin … end - 1``, as far as they are in a piece of a file of sound.

    Raises:
        OSError: the file cannot be read: retention may have taken it away.
    """
    found: dict[int, bytes] = {}
    with path.open("rb") as file:
        for sample, sizes, at in _fragments(file, offset, offset + length):
            number = sample // form.samples
            if number >= end:
                break
            if number + len(sizes) <= begin:
                continue
            file.seek(at)
            data = file.read(sum(sizes))
            edges = pairwise(accumulate(sizes, initial=0))
            found |= {number + place: data[edge:until] for place, (edge, until) in enumerate(edges)}
    return {number: data for number, data in found.items() if begin <= number < end}


def _fragments(file: BufferedReader, at: int, end: int) -> Iterator[tuple[int, tuple[int, ...], int]]:
    """Give each fragment's first sample, the sizes of its frames, and where they are."""
    moof = b""
    while at + _HEAD <= end:
        file.seek(at)
        head = file.read(_HEAD)
        if len(head) < _HEAD:
            return
        size, kind = struct.unpack(">I4s", head)
        if not _HEAD <= size <= end - at:
            return
        if kind == b"moof":
            moof = file.read(size - _HEAD)
        elif kind == b"mdat" and (told := _told(moof)) is not None and sum(told[1]) <= size - _HEAD:
            yield *told, at + _HEAD
        at += size


def _told(moof: bytes) -> tuple[int, tuple[int, ...]] | None:
    """Give what a fragment of `mp4_sound.sound_fragment` says: first sample, sizes."""
    try:
        (sample,) = struct.unpack_from(">Q", moof, moof.index(b"tfdt") + 8)
        at = moof.index(b"trun") + 8
        (count,) = struct.unpack_from(">I", moof, at)
        return sample, struct.unpack_from(f">{count}I", moof, at + 8)
    except (ValueError, struct.error):  # a file that somebody has damaged
        return None
