"""Parameter sets of H.265 (ITU-T H.265, 7.3.2), and how MP4 describes them (ISO/IEC 14496-15, 8.3.3.1)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from server.media.bitstream import unescape_payload
from server.media.h265.nal import HEAD_BYTES, NAL_PPS, NAL_SPS, NAL_VPS, layer_of, nal_type
from server.media.h265.stream_syntax import StreamSyntax, parse_stream_syntax
from server.media.parameter_sets import MAX_SET_BYTES, ParameterSets, UnsupportedParametersError

_PROFILE_AT, _PROFILE_BYTES = 1, 12
"""Where an SPS's payload has profile_tier_level: general profile, compatibility, constraints and level."""


@dataclass(frozen=True, slots=True)
class H265ParameterSets(ParameterSets):
    """Video, sequence and picture parameter sets (VPS, SPS, PPS)."""

    vps: bytes
    sps: bytes
    pps: bytes

    @property
    def entry(self) -> str:
        """The kind of sample entry in MP4: hev1 if they may change (ISO/IEC 14496-15, 8.4.1.1)."""
        return "hev1" if self.may_change else "hvc1"

    @property
    def codec(self) -> str:
        """The codec string (ISO/IEC 14496-15, E.3), e.g. ``hvc1.1.6.L93.B0``."""
        profile, compatibility, constraints, level = struct.unpack(">BI6sB", self._profile)
        space, tier = ("", "A", "B", "C")[profile >> 6], "H" if profile & 0x20 else "L"
        reversed_flags = int(f"{compatibility:032b}"[::-1], 2)
        parts = [self.entry, f"{space}{profile & 0x1F}", f"{reversed_flags:X}", f"{tier}{level}"]
        return ".".join([*parts, *(f"{byte:X}" for byte in constraints.rstrip(b"\x00"))])

    @property
    def configuration_kind(self) -> str:
        """The type of the box with the decoder configuration record."""
        return "hvcC"

    @property
    def configuration(self) -> bytes:
        """The HEVCDecoderConfigurationRecord of 4:2:0 video (ISO/IEC 14496-15, 8.3.3.1)."""
        payload = unescape_payload(self.sps, HEAD_BYTES)
        layers, nested = 1 + (payload[0] >> 1 & 7), payload[0] & 1
        try:
            depth = self.syntax.sequence.bit_depth - 8
        except UnsupportedParametersError:
            depth = 0
        complete = 0x00 if self.may_change else 0x80
        arrays = b"".join(
            struct.pack(">BHH", complete | kind, 1, len(unit)) + unit
            for kind, unit in ((NAL_VPS, self.vps), (NAL_SPS, self.sps), (NAL_PPS, self.pps))
        )
        head = struct.pack(
            ">HBBBBHB", 0xF000, 0xFC, 0xFC | 1, 0xF8 | depth, 0xF8 | depth, 0, layers << 3 | nested << 2 | 3
        )
        return b"\x01" + self._profile + head + b"\x03" + arrays

    @property
    def _profile(self) -> bytes:
        payload = unescape_payload(self.sps, HEAD_BYTES)
        return payload[_PROFILE_AT : _PROFILE_AT + _PROFILE_BYTES].ljust(_PROFILE_BYTES, b"\x00")

    @property
    def syntax(self) -> StreamSyntax:
        """The syntax of the stream's slices.

        Raises:
            UnsupportedParametersError: the sets are damaged, or use features that are not supported here.
        """
        return parse_stream_syntax(self.sps, self.pps)


def parameter_sets(units: Sequence[bytes]) -> H265ParameterSets | None:
    """Return the parameter sets among NAL units; None if one is missing or invalid, or there are several."""
    found: dict[int, bytes] = {}
    for unit in units:
        kind = nal_type(unit)
        if kind not in (NAL_VPS, NAL_SPS, NAL_PPS) or len(unit) <= HEAD_BYTES or layer_of(unit):
            continue
        if len(unit) > MAX_SET_BYTES or found.setdefault(kind, unit) != unit:
            return None
    if len(found) < len((NAL_VPS, NAL_SPS, NAL_PPS)):
        return None
    if len(unescape_payload(found[NAL_SPS], HEAD_BYTES)) <= _PROFILE_AT + _PROFILE_BYTES:
        return None
    return H265ParameterSets(found[NAL_VPS], found[NAL_SPS], found[NAL_PPS])
