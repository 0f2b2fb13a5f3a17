"""What a packet of Opus says about itself (RFC 6716, 3)."""

from __future__ import annotations

_PER_MS = 48
"""Samples in a millisecond."""
_SILK_MS = (10, 20, 40, 60)
_HYBRID_MS = (10, 20)
_CELT_MS = (2.5, 5, 10, 20)
_FIRST_HYBRID, _FIRST_CELT = 12, 16
"""Configurations (table 2)."""
_MANY = 3
"""A code: the number of frames stands in the next byte."""


def packet_samples(packet: bytes) -> int:
    """Return how many samples at 48 kHz a packet holds; 0 where it does not say."""
    if not packet:
        return 0
    config, code = packet[0] >> 3, packet[0] & 3
    if config < _FIRST_HYBRID:
        lasts: float = _SILK_MS[config % 4]
    elif config < _FIRST_CELT:
        lasts = _HYBRID_MS[config % 2]
    else:
        lasts = _CELT_MS[config % 4]
    frames = (1, 2, 2, packet[1] & 0x3F if len(packet) > 1 else 0)[code]
    return round(lasts * _PER_MS) * frames
