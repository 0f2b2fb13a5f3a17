"""NAL units of H.264: their types, parameter sets and MP4 samples (ITU-T H.264, 7.3.1; ISO/IEC 14496-15)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from server.media.nal_units import join_units
from server.media.parameter_sets import MAX_SET_BYTES, ParameterSets

NAL_SLICE = 1
NAL_IDR = 5
NAL_SPS = 7
NAL_PPS = 8
NAL_AUD = 9

_SPS_MIN_BYTES = 4
"""NAL header, profile, constraint flags and level, which the decoder configuration record repeats."""


@dataclass(frozen=True, slots=True)
class H264ParameterSets(ParameterSets):
    """Sequence and picture parameter sets (SPS, PPS)."""

    sps: bytes
    pps: bytes

    @property
    def entry(self) -> str:
        """The kind of sample entry in MP4: avc3 if they may change (ISO/IEC 14496-15, 5.4.2.1.2)."""
        return "avc3" if self.may_change else "avc1"

    @property
    def codec(self) -> str:
        """The codec string of RFC 6381, e.g. ``avc1.42C01E``."""
        return f"{self.entry}.{self.sps[1:4].hex().upper()}"

    @property
    def configuration_kind(self) -> str:
        """The type of the box with the decoder configuration record."""
        return "avcC"

    @property
    def configuration(self) -> bytes:
        """The AVCDecoderConfigurationRecord (ISO/IEC 14496-15, 5.3.3.1)."""
        sps, pps = self.sps, self.pps
        return (
            b"\x01" + sps[1:4] + b"\xff\xe1" + struct.pack(">H", len(sps)) + sps
            + b"\x01" + struct.pack(">H", len(pps)) + pps
        )  # fmt: skip


def nal_type(unit: bytes) -> int:
    """Return nal_unit_type (7.3.1)."""
    return unit[0] & 0x1F


def parameter_sets(units: Sequence[bytes]) -> H264ParameterSets | None:
    """Return the parameter sets among NAL units; None if one is missing or invalid."""
    sps = next((unit for unit in units if nal_type(unit) == NAL_SPS), None)
    pps = next((unit for unit in units if nal_type(unit) == NAL_PPS), None)
    if sps is None or pps is None or len(sps) < _SPS_MIN_BYTES or max(len(sps), len(pps)) > MAX_SET_BYTES:
        return None
    return H264ParameterSets(sps, pps)


def join_sample(units: Sequence[bytes]) -> bytes:
    """Return NAL units as an MP4 sample, without access unit delimiters.

    Parameter sets stay in the sample: a decoder that joins at a cut needs them.
    """
    return join_units([unit for unit in units if nal_type(unit) != NAL_AUD])
