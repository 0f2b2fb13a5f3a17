"""Consecutive frames of a site's audio."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from server.media.audio.audio_format import AudioFormat
from server.media.containers.mp4_audio import audio_fragment


@dataclass(frozen=True)
class AudioChunk:
    """Consecutive audio frames, the first of which has number ``first``; missing ones are silent."""

    first: int
    frames: tuple[bytes, ...]
    format: AudioFormat

    @property
    def silenced(self) -> AudioChunk:
        """The same number of silent frames."""
        return AudioChunk(self.first, (self.format.silence,) * len(self.frames), self.format)

    @cached_property
    def fragment(self) -> bytes:
        """The frames as an MP4 fragment; empty if there are none."""
        return audio_fragment(self.format, self.frames, self.first) if self.frames else b""
