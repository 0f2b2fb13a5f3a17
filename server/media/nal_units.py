"""NAL units in byte streams and MP4 samples (ITU-T H.264 and H.265, annex B; ISO/IEC 14496-15)."""

from __future__ import annotations

import re
from collections.abc import Sequence

_START_CODE = re.compile(b"\x00\x00\x01")


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


def join_units(units: Sequence[bytes]) -> bytes:
    """Return NAL units as an MP4 sample, each behind its length (ISO/IEC 14496-15, 5.3.2)."""
    return b"".join(len(unit).to_bytes(4, "big") + unit for unit in units)
