"""Some of a site's sound."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from server.media.audio.audio_format import SoundFormat
from server.media.containers.mp4_audio import sound_fragment


@dataclass(frozen=True)
class Heard:
    """Consecutive frames of sound from number ``first`` on; those that did not come are silent."""

    first: int
    frames: tuple[bytes, ...]
    format: SoundFormat

    @property
    def silenced(self) -> Heard:
        """As many frames of silence."""
        return Heard(self.first, (self.format.silence,) * len(self.frames), self.format)

    @cached_property
    def fragment(self) -> bytes:
        """The frames as a fragment of MP4; nothing where there are none."""
        return sound_fragment(self.format, self.frames, self.first) if self.frames else b""
