"""Demuxers of the service's own MP4 fragments and WebM clusters, of one frame each."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from server.media.rendering_messages import TIMESCALE

_HEAD = 8
"""Bytes of a box's size and type."""
_CONTAINERS = frozenset({b"moof", b"traf"})
"""Boxes that contain boxes."""
_TFDT_TIME = 4
"""Bytes of version and flags before the time."""
_TRUN_DURATION = 12
"""Bytes of version, flags, sample_count and data_offset, before the first sample's fields."""
_NON_SYNC = 0x00010000
"""sample_is_non_sync_sample."""
_START_CODE = b"\x00\x00\x00\x01"


@dataclass(frozen=True, slots=True)
class DemuxedFrame:
    """One access unit, Annex B, or a VP8 frame."""

    pulse: int
    key: bool
    data: bytes
    duration: int
    """The number of pulses it is shown for."""


def demux_mp4(fragments: bytes, fps: float) -> Iterator[DemuxedFrame]:
    """Yield the frames of MP4 fragments in order."""
    pulse, duration, key = -1, 1, False
    for kind, start, end in _boxes(fragments, 0, len(fragments)):
        if kind == b"tfdt" and end - start >= _TFDT_TIME + 8:
            (ticks,) = struct.unpack_from(">Q", fragments, start + _TFDT_TIME)
            pulse = round(ticks * fps / TIMESCALE)
        elif kind == b"trun" and end - start >= _TRUN_DURATION + 12:
            ticks, _, flags = struct.unpack_from(">3I", fragments, start + _TRUN_DURATION)
            duration, key = max(1, round(ticks * fps / TIMESCALE)), not flags & _NON_SYNC
        elif kind == b"mdat":
            data = b"".join(_START_CODE + unit for unit in _units(fragments, start, end))
            yield DemuxedFrame(pulse, key, data, duration)


def _boxes(data: bytes, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Yield the type, start and end of each box's content, depth first."""
    while start + _HEAD <= end:
        size = int.from_bytes(data[start : start + 4], "big")
        kind = data[start + 4 : start + _HEAD]
        if size < _HEAD or start + size > end:
            return
        yield kind, start + _HEAD, start + size
        if kind in _CONTAINERS:
            yield from _boxes(data, start + _HEAD, start + size)
        start += size


def _units(data: bytes, start: int, end: int) -> Iterator[bytes]:
    """Yield the length-prefixed NAL units of a sample (ISO/IEC 14496-15, 5.3.2)."""
    while start + 4 < end:
        size = int.from_bytes(data[start : start + 4], "big")
        unit = data[start + 4 : min(start + 4 + size, end)]
        if unit:
            yield unit
        start += 4 + size


_TICKS = 1000
_HEAD = 8
"""Bytes of a cluster's element ID and size."""
_TIME = 10
"""Bytes of the element with its time."""
_SIMPLE_BLOCK, _BLOCK_GROUP, _BLOCK, _DURATION = 0xA3, 0xA0, 0xA1, 0x9B
_ELEMENT = 5
"""Bytes of the ID and the size of an inner element."""
_FLAGS = 3
"""Bytes of a block before its flags: track number and relative time."""
_KEY = 0x80


def demux_webm(clusters: bytes, fps: float) -> Iterator[DemuxedFrame]:
    """Yield the frames of WebM clusters in order."""
    at = 0
    while at + _HEAD + _TIME + _ELEMENT <= len(clusters):
        end = at + _HEAD + _size(clusters, at + 4)
        time = int.from_bytes(clusters[at + _HEAD + 2 : at + _HEAD + _TIME], "big")
        block, duration = b"", 1
        for name, content in _inside(clusters[at + _HEAD + _TIME : end]):
            if name in (_SIMPLE_BLOCK, _BLOCK):
                block = content
            elif name == _DURATION:
                duration = max(1, round(int.from_bytes(content, "big") * fps / _TICKS))
        if len(block) <= _FLAGS:
            return
        yield DemuxedFrame(
            round(time * fps / _TICKS), bool(block[_FLAGS] & _KEY), block[_FLAGS + 1 :], duration
        )
        at = end


def _inside(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield ID and content of the elements; a block group is replaced by its elements."""
    at = 0
    while at + _ELEMENT <= len(data):
        end = at + _ELEMENT + _size(data, at + 1)
        content = data[at + _ELEMENT : end]
        if data[at] == _BLOCK_GROUP:
            yield from _inside(content)
        else:
            yield data[at], content
        at = end


def _size(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 4], "big") & 0x0FFFFFFF
