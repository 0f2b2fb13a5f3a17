"""From the fragments of a stream to a plain MP4 file: one table of samples, time from 0 (ISO/IEC 14496-12).

Fragments at a stream's own times play in a browser that is told so; a file of them has a seek bar that begins
hours before its first picture. Pictures are copied, not decoded.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from client.fmp4 import MAX_BOX, BoxReader, Mp4Box, Mp4Error, child, decode_time, timescale

_HEADER = 8
_NOT_SYNC = 0x00010000
"""sample_is_non_sync_sample (8.8.3.1)."""
_TRUN_FLAGS = 0x000701
"""Of the server's fragments: each sample has a duration, a size and flags (8.8.8.1)."""
_TRUN_HEAD = 12
"""Bytes of it before its entries."""
_ENTRY = struct.Struct(">3I")


@dataclass(slots=True)
class _Samples:
    """What a file's fragments hold."""

    moov: Mp4Box | None = None
    sizes: array[int] = field(default_factory=lambda: array("I"))
    times: array[int] = field(default_factory=lambda: array("Q"))
    keys: array[int] = field(default_factory=lambda: array("I"))
    """Numbers of the key pictures, from 1."""
    media: list[tuple[int, int]] = field(default_factory=list)
    """Where the pictures are in the file: offset and length."""
    last_duration: int = 0


def write_plain(fragmented: Path, out: Path) -> None:
    """Write what is in a file of fragments as a plain one. A hole in time stretches the picture before it.

    Raises:
        Mp4Error: the file is not one of MyView's streams.
        OSError: it cannot be read, or ``out`` not written.
    """
    with fragmented.open("rb") as source, out.open("wb") as target:
        samples = _scan(source)
        head = _box("ftyp", b"isom" + struct.pack(">I", 512) + b"isomiso2avc1mp41")
        size = sum(length for _, length in samples.media)
        moov_bytes = len(_moov(samples, 0))
        target.write(head + _moov(samples, len(head) + moov_bytes + 2 * _HEADER))
        target.write(struct.pack(">I4sQ", 1, b"mdat", 2 * _HEADER + size))
        for offset, length in samples.media:
            source.seek(offset)
            target.write(source.read(length))


def _scan(file: BinaryIO) -> _Samples:
    samples = _Samples()
    for kind, offset, length in _top_boxes(file):
        if kind == b"mdat":
            samples.media.append((offset + _HEADER, length - _HEADER))
        elif kind in {b"moov", b"moof"}:
            file.seek(offset)
            (box,) = BoxReader().feed(file.read(length))
            if kind == b"moov":
                samples.moov = box
            else:
                _take(samples, box)
    if samples.moov is None or not samples.sizes:
        raise Mp4Error("there is no media")
    return samples


def _top_boxes(file: BinaryIO) -> Iterator[tuple[bytes, int, int]]:
    offset = 0
    while len(head := file.read(_HEADER)) == _HEADER:
        length, kind = struct.unpack(">I4s", head)
        if not _HEADER <= length <= MAX_BOX:
            raise Mp4Error(f"a box of {length} bytes")
        yield kind, offset, length
        offset += length
        file.seek(offset)


def _take(samples: _Samples, moof: Mp4Box) -> None:
    time = decode_time(moof)
    trun = child(moof.content, b"traf", b"trun")
    entries = trun[_TRUN_HEAD:]
    if int.from_bytes(trun[1:4], "big") != _TRUN_FLAGS or len(entries) % _ENTRY.size:
        raise Mp4Error("its fragments are not those of a MyView server")
    for duration, size, flags in _ENTRY.iter_unpack(entries):
        samples.sizes.append(size)
        samples.times.append(time)
        if not flags & _NOT_SYNC:
            samples.keys.append(len(samples.sizes))
        time += duration
        samples.last_duration = duration


def _moov(samples: _Samples, media_at: int) -> bytes:
    """Give the box that says it all; ``media_at``: where in the file the first picture begins."""
    assert samples.moov is not None  # noqa: S101 — as _scan has made sure
    content, units = samples.moov.content, timescale(samples.moov)
    duration = samples.times[-1] - samples.times[0] + samples.last_duration
    milliseconds = struct.pack(">I", round(duration * 1000 / units))
    mvhd, tkhd = child(content, b"mvhd"), child(content, b"trak", b"tkhd")
    mdia = (b"trak", b"mdia")
    mvhd = mvhd[:12] + struct.pack(">I", 1000) + milliseconds + mvhd[20:]
    return _box(
        "moov",
        _box("mvhd", mvhd),
        _box(
            "trak",
            _box("tkhd", tkhd[:20] + milliseconds + tkhd[24:]),
            _box(
                "mdia",
                _box("mdhd", struct.pack(">I2QIQ2H", 1 << 24, 0, 0, units, duration, 0x55C4, 0)),
                _box("hdlr", child(content, *mdia, b"hdlr")),
                _box(
                    "minf",
                    _box("vmhd", child(content, *mdia, b"minf", b"vmhd")),
                    _box("dinf", child(content, *mdia, b"minf", b"dinf")),
                    _box(
                        "stbl",
                        _box("stsd", child(content, *mdia, b"minf", b"stbl", b"stsd")),
                        *_tables(samples, media_at),
                    ),
                ),
            ),
        ),
    )


def _tables(samples: _Samples, media_at: int) -> Iterator[bytes]:
    """Give the tables of samples: all of them are one chunk."""
    yield _table("stts", _durations(samples))
    yield _table("stss", [(number,) for number in samples.keys])
    yield _table("stsc", [(1, len(samples.sizes), 1)])
    yield _box("stsz", struct.pack(f">3I{len(samples.sizes)}I", 0, 0, len(samples.sizes), *samples.sizes))
    yield _box("co64", struct.pack(">2IQ", 0, 1, media_at))


def _durations(samples: _Samples) -> list[tuple[int, int]]:
    """Give how long pictures are shown, as runs: how many, how long."""
    runs: list[tuple[int, int]] = []
    ends = [*samples.times[1:], samples.times[-1] + samples.last_duration]
    for begin, end in zip(samples.times, ends, strict=True):
        many = runs.pop()[0] if runs and runs[-1][1] == end - begin else 0
        runs.append((many + 1, end - begin))
    return runs


def _table(kind: str, rows: Sequence[tuple[int, ...]]) -> bytes:
    return _box(kind, struct.pack(">2I", 0, len(rows)), *(struct.pack(f">{len(row)}I", *row) for row in rows))


def _box(kind: str, *parts: bytes) -> bytes:
    body = b"".join(parts)
    return struct.pack(">I", _HEADER + len(body)) + kind.encode("ascii") + body
