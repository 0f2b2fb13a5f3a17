"""A site's sound: AAC frames, numbered on the clock of the pulses.

Frame *k* is the 1024 samples from sample 1024 · *k* on, counted from pulse 0 at the site's rate. So which
frames belong to some pulses follows from their numbers alone, whatever is shown meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass

FRAME = 1024
"""Samples in a frame of AAC (ISO/IEC 14496-3)."""

RATES = (96_000, 88_200, 64_000, 48_000, 44_100, 32_000, 24_000, 22_050, 16_000, 12_000, 11_025, 8_000, 7_350)
"""samplingFrequencyIndex (1.6.3.3)."""

_LOW_COMPLEXITY = 2
"""audioObjectType."""
_ICS_INFO = "0" + "00" + "0" + "000000" + "0"
"""A long window whose spectrum has no bands, not predicted (4.4.2.1)."""
_QUIET = "000"
"""No pulses, no noise shaping, no gain control."""
_END = "111"


@dataclass(frozen=True, slots=True)
class SoundFormat:
    """AAC with low complexity; all that a decoder has to be told."""

    rate: int
    """Samples a second."""
    channels: int

    @property
    def codec(self) -> str:
        """RFC 6381."""
        return f"mp4a.40.{_LOW_COMPLEXITY}"

    @property
    def config(self) -> bytes:
        """AudioSpecificConfig (1.6.2.1)."""
        return (_LOW_COMPLEXITY << 11 | RATES.index(self.rate) << 7 | self.channels << 3).to_bytes(2, "big")

    @property
    def silence(self) -> bytes:
        """A frame in which there is nothing to hear."""
        gain = "00000000"
        if self.channels == 1:
            bits = "000" + "0000" + gain + _ICS_INFO + _QUIET
        else:
            bits = "001" + "0000" + "1" + _ICS_INFO + "00" + 2 * (gain + _QUIET)
        bits += _END
        bits += "0" * (-len(bits) % 8)
        return int(bits, 2).to_bytes(len(bits) // 8, "big")

    def frame_at(self, pulse: int, fps: float) -> int:
        """Give the number of the frame that sounds when a pulse is due."""
        return round(pulse * self.rate / fps) // FRAME

    def pulses(self, begin: int, end: int, fps: float) -> tuple[int, int]:
        """Give pulses, the first and the one after the last, among which are all that some frames sound at."""
        first = begin * FRAME * fps / self.rate
        return max(0, int(first) - 1), int((end + 1) * FRAME * fps / self.rate) + 2

    def adts(self, size: int) -> bytes:
        """Give what comes before a frame of ``size`` bytes in a transport stream (1.A.2)."""
        whole = size + 7
        return bytes(
            (
                0xFF,
                0xF1,  # MPEG-4, no checksum
                (_LOW_COMPLEXITY - 1) << 6 | RATES.index(self.rate) << 2 | self.channels >> 2,
                (self.channels & 3) << 6 | whole >> 11,
                whole >> 3 & 0xFF,
                (whole & 7) << 5 | 0x1F,
                0xFC,
            )
        )
