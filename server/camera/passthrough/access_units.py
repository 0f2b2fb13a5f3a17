"""Conversion of access units of H.264 and H.265 from a container's packing to Annex B."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from server.media.containers.decoder_configuration import RECORD_VERSION, parse_decoder_configuration
from server.media.nal_codec import NalCodec
from server.media.nal_units import nal_units

_START_CODE = b"\x00\x00\x00\x01"


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
    if not extradata or extradata[0] != RECORD_VERSION:
        return AccessUnitPacking(codec, 0, tuple(codec.select_sets(nal_units(extradata or b""))))
    record = parse_decoder_configuration(extradata, "h265" if codec.name == "h265" else "h264")
    return AccessUnitPacking(codec, record.length_bytes, record.sets)


def _split_length_prefixed(packet: bytes, length_bytes: int) -> Iterator[bytes]:
    at = 0
    while at < len(packet):
        size = int.from_bytes(packet[at : at + length_bytes], "big")
        at += length_bytes
        if size == 0 or at + size > len(packet):
            raise ValueError("a NAL unit that does not fit into its packet")
        yield packet[at : at + size]
        at += size
