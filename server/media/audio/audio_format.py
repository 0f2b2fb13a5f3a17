"""A site's sound: frames of AAC or Opus, numbered on the clock of the pulses.

Frame *k* begins with sample *k* times those in a frame, counted from pulse 0 at the site's rate. So which
frames belong to some pulses follows from their numbers alone, whatever is shown meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from server.media.audio.aac import SAMPLES as AAC_SAMPLES
from server.media.audio.aac import adts, audio_specific_config, silent_frame

Coding = Literal["aac", "opus"]

OPUS_RATE = 48_000
"""Samples a second that times of Opus are counted in, whatever it was made of (RFC 7845, 4)."""
_OPUS_SAMPLES = 960
"""In a frame of 20 ms, which is what nearly everybody sends."""
_OPUS_SILENCE = (b"\xf8\xff\xfe", b"\xfc\xff\xfe")
"""By channels: 20 ms in the full band by CELT (RFC 6716, 3.1), with the flag for silence set (4.3)."""


@dataclass(frozen=True, slots=True)
class AudioFormat:
    """All that an audio decoder needs to know."""

    rate: int
    """Samples a second."""
    channels: int
    coding: Coding = "aac"

    @property
    def codec(self) -> str:
        """RFC 6381."""
        return "mp4a.40.2" if self.coding == "aac" else "opus"

    @property
    def samples(self) -> int:
        """Samples in a frame."""
        return AAC_SAMPLES if self.coding == "aac" else _OPUS_SAMPLES

    @property
    def config(self) -> bytes:
        """What AAC is described by (AudioSpecificConfig)."""
        return audio_specific_config(self.rate, self.channels)

    @property
    def silence(self) -> bytes:
        """A frame in which there is nothing to hear."""
        return silent_frame(self.channels) if self.coding == "aac" else _OPUS_SILENCE[self.channels - 1]

    def frame_at(self, pulse: int, fps: float) -> int:
        """Return the number of the frame that sounds when a pulse is due."""
        return round(pulse * self.rate / fps) // self.samples

    def pulses(self, begin: int, end: int, fps: float) -> tuple[int, int]:
        """Return first pulse, and the one after the last, among which are all that some frames sound at."""
        first = begin * self.samples * fps / self.rate
        return max(0, int(first) - 1), int((end + 1) * self.samples * fps / self.rate) + 2

    def adts(self, size: int) -> bytes:
        """Return what comes before a frame of AAC of ``size`` bytes in a transport stream."""
        return adts(self.rate, self.channels, size)
