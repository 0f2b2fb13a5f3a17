"""The site's sound."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from server.config.sections.base import OffsetSeconds, Section
from server.media.audio.audio_format import OPUS_RATE, AudioFormat, Coding


class SoundSettings(Section):
    """One sound for the whole site, in every stream."""

    source: str | None = None
    """A camera's id: that camera's sound. Or a file; None: the site has no sound."""
    offset_s: OffsetSeconds = 0.0
    """A file's sound at pulse n is that of its moment n / fps - offset_s; a camera has its own offset."""
    at_end: Literal["stop", "loop"] = "stop"
    """What a file does after its end; a camera has its own."""
    codec: Coding = "aac"
    """Codec in all streams; transport streams have no Opus. A source of this codec, rate and channels is
    passed through; any other is encoded."""
    rate: Literal[48_000, 44_100, 32_000, 24_000] = 48_000
    """Samples a second."""
    channels: Literal[1, 2] = 2
    kbps: Annotated[int, Field(ge=16, le=320)] = 96
    """Bit rate where the sound is encoded."""

    @model_validator(mode="after")
    def _opus_has_its_rate(self) -> Self:
        if self.codec == "opus" and self.rate != OPUS_RATE:
            raise ValueError(f"codec: opus has {OPUS_RATE} samples a second; rate is {self.rate}")
        return self

    @property
    def format(self) -> AudioFormat | None:
        """The audio format of all streams; None: the site has no sound."""
        return None if self.source is None else AudioFormat(self.rate, self.channels, self.codec)
