"""Parses the header of Opus packets (RFC 6716, 3)."""

from __future__ import annotations

_PER_MS = 48
"""Samples per millisecond."""
_SILK_MS = (10, 20, 40, 60)
_HYBRID_MS = (10, 20)
_CELT_MS = (2.5, 5, 10, 20)
_FIRST_HYBRID, _FIRST_CELT = 12, 16
"""The first configuration of each mode (table 2)."""


def packet_samples(packet: bytes) -> int:
    """Return the number of samples at 48 kHz in a packet; 0 if it cannot be read."""
    if not packet:
        return 0
    config, code = packet[0] >> 3, packet[0] & 3
    if config < _FIRST_HYBRID:
        frame_ms: float = _SILK_MS[config % 4]
    elif config < _FIRST_CELT:
        frame_ms = _HYBRID_MS[config % 2]
    else:
        frame_ms = _CELT_MS[config % 4]
    frames = (1, 2, 2, packet[1] & 0x3F if len(packet) > 1 else 0)[code]
    return round(frame_ms * _PER_MS) * frames
