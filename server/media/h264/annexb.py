"""NAL units of H.264 in byte streams and MP4 samples (ITU-T H.264, Annex B; ISO/IEC 14496-15)."""

from __future__ import annotations

import re
from dataclasses import dataclass

_START_CODE = re.compile(b"\x00\x00\x01")

NAL_SLICE = 1
NAL_IDR = 5
NAL_SPS = 7
NAL_PPS = 8
NAL_AUD = 9

_SPS_MIN_BYTES = 4
"""NAL header, profile, constraint flags and level, which the decoder configuration record repeats."""
_SET_MAX_BYTES = 0xFFFF
"""The record's length field has 16 bits."""


@dataclass(frozen=True, slots=True)
class ParameterSets:
    """Sequence and picture parameter sets (SPS, PPS), which a decoder needs before the first picture."""

    sps: bytes
    pps: bytes
    may_change: bool = False
    """Whether they may change in the stream; keyframes then carry the new ones."""

    @property
    def entry(self) -> str:
        """The kind of sample entry in MP4: avc3 if they may change (ISO/IEC 14496-15, 5.4.2.1.2)."""
        return "avc3" if self.may_change else "avc1"

    @property
    def codec(self) -> str:
        """The codec string of RFC 6381, e.g. ``avc1.42C01E``."""
        return f"{self.entry}.{self.sps[1:4].hex().upper()}"


def nal_units(access_unit: bytes) -> list[bytes]:
    """Split an Annex B access unit into its NAL units, without start codes.

    Bytes before the first start code are not part of any unit and are left out, and so are empty units.
    """
    starts = [match.end() for match in _START_CODE.finditer(access_unit)]
    if not starts:
        return []
    ends = [start - 3 for start in starts[1:]] + [len(access_unit)]
    # A 4-byte start code's first zero, and trailing_zero_8bits, belong to no unit (B.1.1).
    units = (access_unit[start:end].rstrip(b"\x00") for start, end in zip(starts, ends, strict=True))
    return [unit for unit in units if unit]


def split_sample(sample: bytes) -> list[bytes]:
    """Split an MP4 sample into its NAL units; an incomplete one is left out."""
    units, at = [], 0
    while at + 4 <= len(sample):
        end = at + 4 + int.from_bytes(sample[at : at + 4], "big")
        if at + 4 < end <= len(sample):
            units.append(sample[at + 4 : end])
        at = end
    return units


def nal_type(unit: bytes) -> int:
    """Return nal_unit_type (7.3.1)."""
    return unit[0] & 0x1F


def parameter_sets(units: list[bytes]) -> ParameterSets | None:
    """Return the parameter sets among NAL units; None if one is missing or invalid."""
    sps = next((unit for unit in units if nal_type(unit) == NAL_SPS), None)
    pps = next((unit for unit in units if nal_type(unit) == NAL_PPS), None)
    if sps is None or pps is None or len(sps) < _SPS_MIN_BYTES or max(len(sps), len(pps)) > _SET_MAX_BYTES:
        return None
    return ParameterSets(sps, pps)


def join_sample(units: list[bytes]) -> bytes:
    """Return NAL units as an MP4 sample, length-prefixed (ISO/IEC 14496-15, 5.3.2).

    Parameter sets stay in the sample: a decoder that joins at a cut needs them.
    """
    return b"".join(len(unit).to_bytes(4, "big") + unit for unit in units if nal_type(unit) != NAL_AUD)
