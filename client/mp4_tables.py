"""The tables of a plain MP4 file: where and when each picture and each bit of sound is (ISO/IEC 14496-12)."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from client.fmp4 import BoxReader, Mp4Box, child

_HEADER = 8
_MOVIE_UNITS = 1000
_NOTHING = -1
"""As the media time of an edit: nothing is shown or heard (8.6.6)."""


@dataclass(slots=True)
class Samples:
    """The samples of one track; ``units`` is its clock's ticks a second."""

    units: int
    sizes: array[int] = field(default_factory=lambda: array("I"))
    times: array[int] = field(default_factory=lambda: array("Q"))
    keys: array[int] = field(default_factory=lambda: array("I"))
    """Numbers of the key pictures, from 1."""
    chunks: list[list[int]] = field(default_factory=list)
    """Samples that lie side by side: where the first is in all media, and how many there are."""
    last_duration: int = 0
    _end: int = -1

    def begin(self, at: int, count: int) -> None:
        """Add a chunk of ``count`` samples that starts at byte ``at`` of all media."""
        if at == self._end:
            self.chunks[-1][1] += count
        else:
            self.chunks.append([at, count])
            self._end = at

    def add(self, size: int, time: int, duration: int) -> None:
        """Take the next sample."""
        self.sizes.append(size)
        self.times.append(time)
        self.last_duration = duration
        self._end += size

    def drop_from(self, time: float) -> None:
        """Leave out the last samples that begin at a time or later."""
        while self.times and self.times[-1] >= time:
            self.times.pop()
            self.sizes.pop()
            self.chunks[-1][1] -= 1
            if not self.chunks[-1][1]:
                self.chunks.pop()

    @property
    def duration(self) -> int:
        """Ticks from the first sample to the end of the last."""
        return self.times[-1] - self.times[0] + self.last_duration


@dataclass(slots=True)
class Film:
    """What a recording holds; ``header`` is the ``moov`` of its fragments."""

    header: Mp4Box
    pictures: Samples
    sound: Samples | None = None

    def end_sound_with_the_pictures(self) -> None:
        """Leave out sound after the last picture; without any that is left there is no track of it."""
        pictures, sound = self.pictures, self.sound
        if sound is not None:
            sound.drop_from((pictures.times[0] + pictures.duration) * sound.units / pictures.units)
            if not sound.sizes:
                self.sound = None


def moov(film: Film, media_at: int) -> bytes:
    """Return the box that says it all; ``media_at``: where in the file the media begin."""
    traks = [it.content for it in BoxReader().feed(film.header.content) if it.kind == b"trak"]
    mvhd = child(film.header.content, b"mvhd")
    duration = _movie_time(film.pictures.duration / film.pictures.units)
    mvhd = mvhd[:12] + struct.pack(">2I", _MOVIE_UNITS, duration) + mvhd[20:]
    tracks = [_trak(traks[0], film.pictures, media_at, b"vmhd", b"")]
    if film.sound is not None:
        tracks.append(_trak(traks[-1], film.sound, media_at, b"smhd", _edits(film.pictures, film.sound)))
    return box("moov", box("mvhd", mvhd), *tracks)


def box(kind: str, *parts: bytes) -> bytes:
    """Return a box."""
    body = b"".join(parts)
    return struct.pack(">I", _HEADER + len(body)) + kind.encode("ascii") + body


def _movie_time(seconds: float) -> int:
    return round(seconds * _MOVIE_UNITS)


def _edits(pictures: Samples, sound: Samples) -> bytes:
    """Return how the sound goes with the pictures, which begin at 0: what is before them is not heard."""
    early = pictures.times[0] / pictures.units - sound.times[0] / sound.units
    lasts = sound.duration / sound.units
    if early >= 0:
        edits = [(_movie_time(lasts - early), round(early * sound.units))]
    else:
        edits = [(_movie_time(-early), _NOTHING), (_movie_time(lasts), 0)]
    entries = b"".join(struct.pack(">Ii2H", duration, time, 1, 0) for duration, time in edits)
    return box("edts", box("elst", struct.pack(">2I", 0, len(edits)) + entries))


def _trak(trak: bytes, samples: Samples, media_at: int, media_header: bytes, edits: bytes) -> bytes:
    tkhd, mdia = child(trak, b"tkhd"), child(trak, b"mdia")
    duration = samples.duration
    movie_time = struct.pack(">I", _movie_time(duration / samples.units))
    return box(
        "trak",
        box("tkhd", tkhd[:20] + movie_time + tkhd[24:]),
        edits,
        box(
            "mdia",
            box("mdhd", struct.pack(">I2QIQ2H", 1 << 24, 0, 0, samples.units, duration, 0x55C4, 0)),
            box("hdlr", child(mdia, b"hdlr")),
            box(
                "minf",
                box(media_header.decode("ascii"), child(mdia, b"minf", media_header)),
                box("dinf", child(mdia, b"minf", b"dinf")),
                box(
                    "stbl",
                    box("stsd", child(mdia, b"minf", b"stbl", b"stsd")),
                    *_tables(samples, media_at),
                ),
            ),
        ),
    )


def _tables(samples: Samples, media_at: int) -> Iterator[bytes]:
    """Yield the tables of samples."""
    yield _table("stts", _durations(samples))
    if samples.keys:
        yield _table("stss", [(number,) for number in samples.keys])
    yield _table("stsc", _chunk_lengths(samples))
    yield box("stsz", struct.pack(f">3I{len(samples.sizes)}I", 0, 0, len(samples.sizes), *samples.sizes))
    places = [media_at + at for at, _ in samples.chunks]
    yield box("co64", struct.pack(f">2I{len(places)}Q", 0, len(places), *places))


def _durations(samples: Samples) -> list[tuple[int, int]]:
    """Return how long samples last, as runs: how many, how long."""
    runs: list[tuple[int, int]] = []
    ends = [*samples.times[1:], samples.times[-1] + samples.last_duration]
    for begin, end in zip(samples.times, ends, strict=True):
        many = runs.pop()[0] if runs and runs[-1][1] == end - begin else 0
        runs.append((many + 1, end - begin))
    return runs


def _chunk_lengths(samples: Samples) -> list[tuple[int, int, int]]:
    """Return how many samples a chunk has, where that changes: chunk from 1 on, how many, of which kind."""
    rows, number = [], 1
    for count, same in groupby(count for _, count in samples.chunks):
        rows.append((number, count, 1))
        number += sum(1 for _ in same)
    return rows


def _table(kind: str, rows: Sequence[tuple[int, ...]]) -> bytes:
    return box(kind, struct.pack(">2I", 0, len(rows)), *(struct.pack(f">{len(row)}I", *row) for row in rows))
