"""Whether a source's sound is passed on or encoded."""

from __future__ import annotations

from fractions import Fraction

from av.audio.stream import AudioStream

from server.camera.audio.encoder import Encoding
from server.camera.audio.frames import Frame, Packet, Way
from server.camera.audio.passthrough import Passing, fits
from server.media.audio.audio_format import SoundFormat
from server.media.audio.opus import samples_in


def way_for(stream: AudioStream, form: SoundFormat, kbps: int) -> Way:
    """Pass on what is as the site's sound is to be, encode all else."""
    if not fits(stream, form):
        return Encoding(form, kbps)
    return Passing(form) if form.coding == "aac" else _ByItsFirst(form, kbps)


class _ByItsFirst:
    """Opus says only packet by packet how long its frames are: the first one decides for all."""

    def __init__(self, form: SoundFormat, kbps: int) -> None:
        self._form, self._kbps = form, kbps
        self._way: Way | None = None

    def take(self, packet: Packet, at: Fraction) -> list[Frame]:
        """Return what becomes whole by a packet."""
        if self._way is None:
            passes = samples_in(bytes(packet)) == self._form.samples
            self._way = Passing(self._form) if passes else Encoding(self._form, self._kbps)
        return self._way.take(packet, at)
