"""A site's audio format: frames of AAC or Opus, numbered on the clock of the pulses.

Frame *k* begins at sample *k* times the samples per frame, counted from pulse 0 at the site's rate. So the
frames of a pulse follow from their numbers alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from server.media.audio.aac import SAMPLES as AAC_SAMPLES
from server.media.audio.aac import adts, audio_specific_config, silent_frame

Coding = Literal["aac", "opus"]

OPUS_RATE = 48_000
"""Samples per second in which Opus counts time, whatever the input rate was (RFC 7845, 4)."""
_OPUS_SAMPLES = 960
"""Samples in a frame of 20 ms, the duration that nearly all encoders use."""
_OPUS_SILENCE = (b"\xf8\xff\xfe", b"\xfc\xff\xfe")
"""By channels: 20 ms in the full band by CELT (RFC 6716, 3.1), with the flag for silence set (4.3)."""


@dataclass(frozen=True, slots=True)
class AudioFormat:
    """The parameters of an audio decoder."""

    rate: int
    """Samples per second."""
    channels: int
    coding: Coding = "aac"

    @property
    def codec(self) -> str:
        """The codec string of RFC 6381."""
        return "mp4a.40.2" if self.coding == "aac" else "opus"

    @property
    def samples(self) -> int:
        """Samples per frame."""
        return AAC_SAMPLES if self.coding == "aac" else _OPUS_SAMPLES

    @property
    def aac_config(self) -> bytes:
        """AudioSpecificConfig of AAC; meaningless for Opus."""
        return audio_specific_config(self.rate, self.channels)

    @property
    def silence(self) -> bytes:
        """A frame of silence."""
        return silent_frame(self.channels) if self.coding == "aac" else _OPUS_SILENCE[self.channels - 1]

    def frame_at(self, pulse: int, fps: float) -> int:
        """Return the number of the frame that plays at a pulse."""
        return round(pulse * self.rate / fps) // self.samples

    def pulses_of_frames(self, first_frame: int, until_frame: int, fps: float) -> tuple[int, int]:
        """Return the pulses ``(first, until)`` that cover the frames ``first_frame … until_frame - 1``."""
        first = first_frame * self.samples * fps / self.rate
        return max(0, int(first) - 1), int((until_frame + 1) * self.samples * fps / self.rate) + 2

    def adts(self, size: int) -> bytes:
        """Return the ADTS header of an AAC frame of ``size`` bytes."""
        return adts(self.rate, self.channels, size)
