"""Conversion of access units of H.264 and H.265 from a container's packing to Annex B."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from server.media.nal_codec import NalCodec
from server.media.nal_units import nal_units

_START_CODE = b"\x00\x00\x00\x01"
_RECORD_VERSION = 1
"""The first byte of a decoder configuration record."""
_AVCC_LENGTH_AT, _HVCC_LENGTH_AT = 4, 21
"""Offsets of the byte whose lowest two bits are the bytes of a length, less one; the sets follow."""


@dataclass(frozen=True, slots=True)
class AccessUnitPacking:
    """How a container packs access units, by its ``extradata``."""

    codec: NalCodec
    length_bytes: int
    """Bytes of the length before each NAL unit; 0: start codes instead."""
    sets: tuple[bytes, ...]
    """The parameter sets, which may be missing from the units."""

    def annex_b(self, packet: bytes) -> bytes:
        """Return the NAL units with start codes; a keyframe begins with the parameter sets.

        Raises:
            ValueError: the lengths do not fit.
        """
        data = packet
        if self.length_bytes:
            data = b"".join(_START_CODE + unit for unit in _split_length_prefixed(packet, self.length_bytes))
        units = nal_units(data)
        if self.codec.is_keyframe(units) and not self.codec.select_sets(units):
            return b"".join(_START_CODE + unit for unit in self.sets) + data
        return data


def parse_packing(extradata: bytes | None, codec: NalCodec) -> AccessUnitPacking:
    """Parse the ``extradata`` of a stream: a decoder configuration record or NAL units.

    Raises:
        ValueError: it is damaged.
    """
    if not extradata or extradata[0] != _RECORD_VERSION:
        return AccessUnitPacking(codec, 0, tuple(codec.select_sets(nal_units(extradata or b""))))
    length_at = _HVCC_LENGTH_AT if codec.name == "h265" else _AVCC_LENGTH_AT
    if len(extradata) < length_at + 3:
        raise ValueError(f"its {'hvcC' if codec.name == 'h265' else 'avcC'} box is damaged")
    sets = _hvcc_sets(extradata) if codec.name == "h265" else _avcc_sets(extradata)
    return AccessUnitPacking(codec, 1 + (extradata[length_at] & 3), tuple(sets))


def _avcc_sets(record: bytes) -> Iterator[bytes]:
    """Yield the parameter sets of an AVCDecoderConfigurationRecord (ISO/IEC 14496-15, 5.3.3.1)."""
    at = _AVCC_LENGTH_AT + 1
    for mask in (0x1F, 0xFF):  # SPS, then PPS; the upper bits of the first number are reserved
        if at >= len(record):
            break
        count, at = record[at] & mask, at + 1
        for _ in range(count):
            size = int.from_bytes(record[at : at + 2], "big")
            yield record[at + 2 : at + 2 + size]
            at += 2 + size


def _hvcc_sets(record: bytes) -> Iterator[bytes]:
    """Yield the units of an HEVCDecoderConfigurationRecord (ISO/IEC 14496-15, 8.3.3.1)."""
    at = _HVCC_LENGTH_AT + 2
    for _ in range(record[_HVCC_LENGTH_AT + 1]):
        count, at = int.from_bytes(record[at + 1 : at + 3], "big"), at + 3
        for _ in range(count):
            if at >= len(record):
                return
            size = int.from_bytes(record[at : at + 2], "big")
            yield record[at + 2 : at + 2 + size]
            at += 2 + size


def _split_length_prefixed(packet: bytes, length_bytes: int) -> Iterator[bytes]:
    at = 0
    while at < len(packet):
        size = int.from_bytes(packet[at : at + length_bytes], "big")
        at += length_bytes
        if size == 0 or at + size > len(packet):
            raise ValueError("a NAL unit that does not fit into its packet")
        yield packet[at : at + size]
        at += size
