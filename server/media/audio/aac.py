"""AAC Low Complexity (ISO/IEC 14496-3): headers, and a silent frame."""

from __future__ import annotations

SAMPLES = 1024
"""Samples per frame."""

RATES = (96_000, 88_200, 64_000, 48_000, 44_100, 32_000, 24_000, 22_050, 16_000, 12_000, 11_025, 8_000, 7_350)
"""By samplingFrequencyIndex (1.6.3.3)."""

_LOW_COMPLEXITY = 2
"""audioObjectType."""
_ICS_INFO = "0" + "00" + "0" + "000000" + "0"
"""A long window whose spectrum has no bands, not predicted (4.4.2.1)."""
_QUIET = "000"
"""No pulses, no noise shaping, no gain control."""
_END = "111"


def audio_specific_config(rate: int, channels: int) -> bytes:
    """Return AudioSpecificConfig (1.6.2.1), the decoder's configuration."""
    return (_LOW_COMPLEXITY << 11 | RATES.index(rate) << 7 | channels << 3).to_bytes(2, "big")


def silent_frame(channels: int) -> bytes:
    """Return a frame of silence."""
    gain = "00000000"
    if channels == 1:
        bits = "000" + "0000" + gain + _ICS_INFO + _QUIET
    else:
        bits = "001" + "0000" + "1" + _ICS_INFO + "00" + 2 * (gain + _QUIET)
    bits += _END
    bits += "0" * (-len(bits) % 8)
    return int(bits, 2).to_bytes(len(bits) // 8, "big")


def adts(rate: int, channels: int, size: int) -> bytes:
    """Return the ADTS header of a frame of ``size`` bytes (1.A.2)."""
    frame_bytes = size + 7
    return bytes(
        (
            0xFF,
            0xF1,  # MPEG-4, no checksum
            (_LOW_COMPLEXITY - 1) << 6 | RATES.index(rate) << 2 | channels >> 2,
            (channels & 3) << 6 | frame_bytes >> 11,
            frame_bytes >> 3 & 0xFF,
            (frame_bytes & 7) << 5 | 0x1F,
            0xFC,
        )
    )
