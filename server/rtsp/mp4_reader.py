"""Incremental reader of the service's fragmented MP4: its tracks and their samples (ISO/IEC 14496-12).

Fragmented MP4 rather than a transport stream: the end of each sample is known at once, and it carries Opus.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from server.media.containers.decoder_configuration import parse_decoder_configuration

MAX_BOX_BYTES = 16_000_000
"""A fragment of video has some thousand bytes."""
_HEADER = struct.Struct(">I4s")
_LARGE_BYTES = 16
_NON_SYNC = 0x00010000
"""sample_is_non_sync_sample (8.8.3.1)."""
_TRUN_OFFSET, _TRUN_FIRST_FLAGS, _TRUN_DURATION, _TRUN_SIZE, _TRUN_FLAGS, _TRUN_COMPOSITION = (
    0x1, 0x4, 0x100, 0x200, 0x400, 0x800,
)  # fmt: skip
_TFHD_BASE, _TFHD_DESCRIPTION, _TFHD_DURATION, _TFHD_SIZE, _TFHD_FLAGS = 0x1, 0x2, 0x8, 0x10, 0x20
_NAL_SPS, _NAL_SPS_H265 = 7, 33
_SAMPLE_ENTRY_VIDEO, _SAMPLE_ENTRY_AUDIO = 78, 28
"""Bytes of a sample entry before its boxes."""


class Mp4Error(ValueError):
    """The bytes are not such a stream."""


@dataclass(frozen=True, slots=True)
class Track:
    """A track of the stream."""

    number: int
    timescale: int
    """Ticks a second."""
    codec: str
    """h264, h265, aac or opus."""
    configuration: bytes
    """H.264 and H.265: the decoder configuration record; AAC: AudioSpecificConfig; Opus: nothing."""
    rate: int = 0
    """Audio: samples a second."""
    channels: int = 0

    @property
    def is_video(self) -> bool:
        """Whether it is the video."""
        return self.codec in {"h264", "h265"}


@dataclass(frozen=True, slots=True)
class Head:
    """The tracks of a stream: at its beginning, and again after each reconnection."""

    tracks: tuple[Track, ...]


@dataclass(frozen=True, slots=True)
class Sample:
    """An access unit or audio frame."""

    track: Track
    time_s: float
    """Media time, seconds."""
    duration_s: float
    is_key: bool
    data: bytes = field(repr=False)


def with_parameter_sets(sample: bytes, track: Track) -> bytes:
    """Return a keyframe with its track's parameter sets before it, unless it has its own.

    Not by the payloader, which would put them between the slices of a picture, too. Lengths have four bytes.

    Raises:
        Mp4Error: the configuration is not a decoder configuration record (ISO/IEC 14496-15).
    """
    is_h265, at = track.codec == "h265", 0
    while at + 5 <= len(sample):
        kind = sample[at + 4] >> 1 & 0x3F if is_h265 else sample[at + 4] & 0x1F
        if kind == (_NAL_SPS_H265 if is_h265 else _NAL_SPS):
            return sample
        at += 4 + int.from_bytes(sample[at : at + 4], "big")
    try:
        record = parse_decoder_configuration(track.configuration, "h265" if is_h265 else "h264")
    except ValueError as error:
        raise Mp4Error(f"the description of the video: {error}") from error
    return b"".join(len(unit).to_bytes(4, "big") + unit for unit in record.sets) + sample


class Mp4Reader:
    """Splits the bytes of one connection into its head and samples."""

    def __init__(self) -> None:
        self._rest = bytearray()
        self._tracks: Mapping[int, Track] = {}
        self._fragment: _Fragment | None = None

    def feed(self, data: bytes) -> Iterator[Head | Sample]:
        """Yield what ``data`` completes.

        Raises:
            Mp4Error: the bytes are not fragmented MP4 as the service writes it.
        """
        self._rest += data
        while (size := _box_bytes(self._rest)) is not None and len(self._rest) >= size:
            kind, content = next(_boxes(bytes(self._rest[:size])))
            del self._rest[:size]
            try:
                yield from self._parse(kind, content)
            except (struct.error, IndexError, ZeroDivisionError) as error:
                raise Mp4Error(f"a box {kind!r} is incomplete") from error

    def _parse(self, kind: bytes, content: bytes) -> Iterator[Head | Sample]:
        if kind == b"moov":
            head = Head(tuple(_track(trak) for name, trak in _boxes(content) if name == b"trak"))
            self._tracks = {track.number: track for track in head.tracks}
            yield head
        elif kind == b"moof":
            self._fragment = _fragment(_child(content, b"traf"), self._tracks)
        elif kind == b"mdat" and self._fragment is not None:
            fragment, self._fragment = self._fragment, None
            yield from fragment.samples(content)


@dataclass(frozen=True, slots=True)
class _Run:
    """A sample in the header of a fragment: ticks, bytes."""

    duration: int
    size: int
    is_key: bool


@dataclass(frozen=True, slots=True)
class _Fragment:
    """The header of a fragment."""

    track: Track
    time: int
    run: tuple[_Run, ...]

    def samples(self, data: bytes) -> Iterator[Sample]:
        time, at, scale = self.time, 0, self.track.timescale
        for entry in self.run:
            if at + entry.size > len(data):
                raise Mp4Error("a fragment is shorter than its samples")
            content = data[at : at + entry.size]
            yield Sample(self.track, time / scale, entry.duration / scale, entry.is_key, content)
            time, at = time + entry.duration, at + entry.size


def _fragment(traf: bytes, tracks: Mapping[int, Track]) -> _Fragment:
    flags, number = struct.unpack_from(">II", header := _child(traf, b"tfhd"))
    at = 8 + (8 if flags & _TFHD_BASE else 0) + (4 if flags & _TFHD_DESCRIPTION else 0)
    defaults = {}
    for flag in (_TFHD_DURATION, _TFHD_SIZE, _TFHD_FLAGS):
        if flags & flag:
            (defaults[flag],) = struct.unpack_from(">I", header, at)
            at += 4
    if number not in tracks:
        raise Mp4Error(f"a fragment of an unknown track {number}")
    tfdt = _child(traf, b"tfdt")
    (time,) = struct.unpack_from(">Q" if tfdt[0] else ">I", tfdt, 4)
    return _Fragment(tracks[number], time, tuple(_run(_child(traf, b"trun"), defaults)))


def _run(trun: bytes, defaults: Mapping[int, int]) -> Iterator[_Run]:
    flags, count = struct.unpack_from(">II", trun)
    at = 8 + (4 if flags & _TRUN_OFFSET else 0) + (4 if flags & _TRUN_FIRST_FLAGS else 0)
    present = [flag for flag in (_TRUN_DURATION, _TRUN_SIZE, _TRUN_FLAGS, _TRUN_COMPOSITION) if flags & flag]
    entry = struct.Struct(f">{len(present)}I")
    for _ in range(count):
        values = dict(zip(present, entry.unpack_from(trun, at), strict=True))
        at += entry.size
        sample_flags = values.get(_TRUN_FLAGS, defaults.get(_TFHD_FLAGS, 0))
        yield _Run(
            values.get(_TRUN_DURATION, defaults.get(_TFHD_DURATION, 0)),
            values.get(_TRUN_SIZE, defaults.get(_TFHD_SIZE, 0)),
            not sample_flags & _NON_SYNC,
        )


def _track(trak: bytes) -> Track:
    tkhd, mdia = _child(trak, b"tkhd"), _child(trak, b"mdia")
    (number,) = struct.unpack_from(">I", tkhd, 20 if tkhd[0] else 12)
    mdhd = _child(mdia, b"mdhd")
    (timescale,) = struct.unpack_from(">I", mdhd, 20 if mdhd[0] else 12)
    if not timescale:
        raise Mp4Error("a track's timescale is 0")
    kind, entry = next(_boxes(_child(mdia, b"minf", b"stbl", b"stsd")[8:]), (b"", b""))
    if kind in {b"avc1", b"avc3"}:
        return Track(number, timescale, "h264", _child(entry[_SAMPLE_ENTRY_VIDEO:], b"avcC"))
    if kind in {b"hvc1", b"hev1"}:
        return Track(number, timescale, "h265", _child(entry[_SAMPLE_ENTRY_VIDEO:], b"hvcC"))
    channels, _, _, _, rate = struct.unpack_from(">4HI", entry, 16)
    codec = {b"mp4a": "aac", b"Opus": "opus"}.get(kind)
    if codec is None:
        raise Mp4Error(f"a track of an unknown codec {kind!r}")
    inner = entry[_SAMPLE_ENTRY_AUDIO:]
    configuration = _audio_specific_config(_child(inner, b"esds")[4:]) if codec == "aac" else b""
    return Track(number, timescale, codec, configuration, rate >> 16, channels)


def _audio_specific_config(descriptors: bytes) -> bytes:
    """Return the decoder's configuration of AAC: descriptor 5 in 4 in 3 (ISO/IEC 14496-1, 7.2.6)."""
    for tag, fixed_bytes in ((3, 3), (4, 13), (5, 0)):
        at, length = 1, 0
        if descriptors[0] != tag:
            raise Mp4Error("the description of AAC is not understood")
        while True:
            length = length << 7 | descriptors[at] & 0x7F
            at += 1
            if not descriptors[at - 1] & 0x80:
                break
        descriptors = descriptors[at : at + length][fixed_bytes:]
    return descriptors


def _box_bytes(data: bytes | bytearray, at: int = 0) -> int | None:
    """Return the size of the box at an offset; None if its header is incomplete."""
    if len(data) < at + _HEADER.size:
        return None
    size, _ = _HEADER.unpack_from(data, at)
    if size == 1:
        if len(data) < at + _LARGE_BYTES:
            return None
        (size,) = struct.unpack_from(">Q", data, at + _HEADER.size)
    if not _HEADER.size <= size <= MAX_BOX_BYTES:
        raise Mp4Error(f"a box of {size} bytes")
    return int(size)


def _boxes(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield type and content of consecutive boxes; an incomplete last one is left out."""
    at = 0
    while (size := _box_bytes(content, at)) is not None and at + size <= len(content):
        short, kind = _HEADER.unpack_from(content, at)
        header = _LARGE_BYTES if short == 1 else _HEADER.size
        yield kind, content[at + header : at + size]
        at += size


def _child(content: bytes, *path: bytes) -> bytes:
    for wanted in path:
        found = next((inner for kind, inner in _boxes(content) if kind == wanted), None)
        if found is None:
            raise Mp4Error(f"there is no box {wanted!r}")
        content = found
    return content
