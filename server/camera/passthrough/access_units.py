"""Conversion of H.264 access units from a container's packing to Annex B."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from server.media.h264.annexb import NAL_IDR, NAL_PPS, NAL_SPS, nal_type
from server.media.nal_units import nal_units

_START_CODE = b"\x00\x00\x00\x01"
_AVCC_VERSION = 1
_AVCC_HEAD = 6
"""Bytes of an avcC box before the first parameter set's length."""


@dataclass(frozen=True, slots=True)
class AccessUnitPacking:
    """How a container packs access units, by its ``extradata``."""

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
        types = [nal_type(unit) for unit in nal_units(data)]
        if NAL_IDR in types and NAL_SPS not in types:
            return b"".join(_START_CODE + unit for unit in self.sets) + data
        return data


def parse_packing(extradata: bytes | None) -> AccessUnitPacking:
    """Parse the ``extradata`` of a stream: avcC (ISO/IEC 14496-15, 5.3.3.1) or NAL units.

    Raises:
        ValueError: it is damaged.
    """
    if not extradata or extradata[0] != _AVCC_VERSION:
        units = nal_units(extradata or b"")
        return AccessUnitPacking(0, tuple(unit for unit in units if nal_type(unit) in (NAL_SPS, NAL_PPS)))
    if len(extradata) < _AVCC_HEAD + 1:
        raise ValueError("its avcC box is damaged")
    sets: list[bytes] = []
    at = _AVCC_HEAD - 1
    for mask in (0x1F, 0xFF):  # SPS, then PPS; the upper bits of the first number are reserved
        if at >= len(extradata):
            break
        count, at = extradata[at] & mask, at + 1
        for _ in range(count):
            size = int.from_bytes(extradata[at : at + 2], "big")
            sets.append(extradata[at + 2 : at + 2 + size])
            at += 2 + size
    return AccessUnitPacking(1 + (extradata[4] & 3), tuple(sets))


def is_keyframe(annex_b: bytes) -> bool:
    """Return whether an access unit can be decoded without earlier ones."""
    return any(nal_type(unit) == NAL_IDR for unit in nal_units(annex_b))


def _split_length_prefixed(packet: bytes, length_bytes: int) -> Iterator[bytes]:
    at = 0
    while at < len(packet):
        size = int.from_bytes(packet[at : at + length_bytes], "big")
        at += length_bytes
        if size == 0 or at + size > len(packet):
            raise ValueError("a NAL unit that does not fit into its packet")
        yield packet[at : at + size]
        at += size
