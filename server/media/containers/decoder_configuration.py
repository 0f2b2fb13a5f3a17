"""Reading of decoder configuration records, by which MP4 and Matroska describe H.264 and H.265.

The RTSP gateway uses it, too: it needs the standard library only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

RECORD_VERSION = 1
"""The first byte of a record."""
_AVCC_LENGTH_AT, _HVCC_LENGTH_AT = 4, 21
"""Offsets of the byte whose lowest two bits are the bytes of a length, less one; the sets follow."""


@dataclass(frozen=True, slots=True)
class DecoderConfiguration:
    """What a record says.

    Attributes:
        length_bytes: bytes of the length before each NAL unit of a sample.
        sets: the parameter sets, in their order; H.265: with other units that come before all pictures.
    """

    length_bytes: int
    sets: tuple[bytes, ...]


def parse_decoder_configuration(record: bytes, codec: Literal["h264", "h265"]) -> DecoderConfiguration:
    """Parse a record (ISO/IEC 14496-15, 5.3.3.1 and 8.3.3.1).

    Raises:
        ValueError: it is damaged.
    """
    is_h265, sets = codec == "h265", list[bytes]()
    reader = _Reader(record if record[:1] == bytes([RECORD_VERSION]) else b"")
    try:
        reader.take(_HVCC_LENGTH_AT if is_h265 else _AVCC_LENGTH_AT)
        length_bytes = 1 + (reader.number(1) & 3)
        if is_h265:
            for _ in range(reader.number(1)):
                reader.take(1)  # their type
                sets += reader.units(reader.number(2))
        else:
            sets += reader.units(reader.number(1) & 0x1F)  # SPS; the upper bits are reserved
            sets += reader.units(reader.number(1))  # PPS
    except _DamagedError:
        raise ValueError(f"its {'hvcC' if is_h265 else 'avcC'} box is damaged") from None
    return DecoderConfiguration(length_bytes, tuple(sets))


class _DamagedError(Exception):
    """The record ends too early, or is of another version."""


class _Reader:
    """Takes bytes from the start of a record."""

    def __init__(self, record: bytes) -> None:
        self._record, self._at = record, 0

    def take(self, size: int) -> bytes:
        end = self._at + size
        if end > len(self._record):
            raise _DamagedError
        taken, self._at = self._record[self._at : end], end
        return taken

    def number(self, size: int) -> int:
        return int.from_bytes(self.take(size), "big")

    def units(self, count: int) -> list[bytes]:
        """Take NAL units, each behind its length; empty ones are left out."""
        units = [self.take(self.number(2)) for _ in range(count)]
        return [unit for unit in units if unit]
