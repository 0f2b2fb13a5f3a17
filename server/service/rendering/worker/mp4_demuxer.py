"""Frames out of MP4 fragments as the service makes them: one frame each, its time in ``tfdt``."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from server.media.h264.annexb import NAL_IDR, nal_type
from server.media.rendering_messages import TIMESCALE

_HEAD = 8
"""Bytes of a box's size and kind."""
_INSIDE = frozenset({b"moof", b"traf"})
"""Boxes that hold boxes."""
_TFDT_TIME = 4
"""Bytes of version and flags before the time."""
_TRUN_DURATION = 12
"""Bytes of version and flags, the number of samples and where they are, before the first one's duration."""
_START_CODE = b"\x00\x00\x00\x01"


@dataclass(frozen=True, slots=True)
class Frame:
    """One access unit, Annex B, or a frame of VP8."""

    pulse: int
    key: bool
    data: bytes
    lasts: int
    """Pulses that it is shown for."""


def frames(fragments: bytes, fps: float) -> Iterator[Frame]:
    """Give the frames of fragments in order."""
    pulse, lasts = -1, 1
    for kind, start, end in _boxes(fragments, 0, len(fragments)):
        if kind == b"tfdt" and end - start >= _TFDT_TIME + 8:
            (ticks,) = struct.unpack_from(">Q", fragments, start + _TFDT_TIME)
            pulse = round(ticks * fps / TIMESCALE)
        elif kind == b"trun" and end - start >= _TRUN_DURATION + 4:
            (ticks,) = struct.unpack_from(">I", fragments, start + _TRUN_DURATION)
            lasts = max(1, round(ticks * fps / TIMESCALE))
        elif kind == b"mdat":
            units = list(_units(fragments, start, end))
            key = any(nal_type(unit) == NAL_IDR for unit in units)
            yield Frame(pulse, key, b"".join(_START_CODE + unit for unit in units), lasts)


def _boxes(data: bytes, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Give kind, start and end of the boxes' contents, those inside others after them."""
    while start + _HEAD <= end:
        size = int.from_bytes(data[start : start + 4], "big")
        kind = data[start + 4 : start + _HEAD]
        if size < _HEAD or start + size > end:
            return
        yield kind, start + _HEAD, start + size
        if kind in _INSIDE:
            yield from _boxes(data, start + _HEAD, start + size)
        start += size


def _units(data: bytes, start: int, end: int) -> Iterator[bytes]:
    """Give the NAL units of a sample, each behind its length (ISO/IEC 14496-15, 5.3.2)."""
    while start + 4 < end:
        size = int.from_bytes(data[start : start + 4], "big")
        unit = data[start + 4 : min(start + 4 + size, end)]
        if unit:
            yield unit
        start += 4 + size
