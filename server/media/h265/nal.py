"""NAL units of H.265: their headers, and MP4 samples (ITU-T H.265, 7.3.1.2)."""

from __future__ import annotations

from collections.abc import Sequence

from server.media.nal_units import join_units

NAL_TRAIL_N, NAL_TRAIL_R = 0, 1
NAL_IDR_W_RADL, NAL_IDR_N_LP = 19, 20
NAL_VPS, NAL_SPS, NAL_PPS = 32, 33, 34
NAL_AUD = 35
HEAD_BYTES = 2
"""Bytes of a NAL unit's header."""
_FIRST_IRAP, _LAST_IRAP = 16, 23
_LAST_PICTURE = 31


def nal_type(unit: bytes) -> int:
    """Return nal_unit_type."""
    return unit[0] >> 1 & 0x3F


def is_picture(unit: bytes) -> bool:
    """Return whether a NAL unit is a slice segment of a picture of the base layer."""
    return nal_type(unit) <= _LAST_PICTURE and len(unit) > HEAD_BYTES and not layer_of(unit)


def is_irap(unit: bytes) -> bool:
    """Return whether a NAL unit is of a picture at which decoding can begin (IDR, BLA or CRA)."""
    return _FIRST_IRAP <= nal_type(unit) <= _LAST_IRAP


def is_idr(unit: bytes) -> bool:
    """Return whether a NAL unit is of an IDR picture."""
    return nal_type(unit) in (NAL_IDR_W_RADL, NAL_IDR_N_LP)


def join_sample(units: Sequence[bytes]) -> bytes:
    """Return NAL units as an MP4 sample, without access unit delimiters.

    Parameter sets stay in the sample: a decoder that joins at a cut needs them.
    """
    return join_units([unit for unit in units if nal_type(unit) != NAL_AUD])


def layer_of(unit: bytes) -> int:
    """Return nuh_layer_id; 0: the base layer."""
    return (unit[0] & 1) << 5 | unit[1] >> 3 if len(unit) >= HEAD_BYTES else 0
