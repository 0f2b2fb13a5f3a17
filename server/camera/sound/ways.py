"""Whether a source's sound is passed on or encoded."""

from __future__ import annotations

from fractions import Fraction

from av.audio.stream import AudioStream

from server.camera.sound.encoding import Encoding
from server.camera.sound.frames import Frame, Packet, Way
from server.camera.sound.opus import samples_in
from server.camera.sound.passing import Passing, fits
from server.wire.sound import SoundFormat


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
        """Give what becomes whole by a packet."""
        if self._way is None:
            passes = samples_in(bytes(packet)) == self._form.samples
            self._way = Passing(self._form) if passes else Encoding(self._form, self._kbps)
        return self._way.take(packet, at)
