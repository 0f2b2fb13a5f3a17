"""Whether a source's sound is passed on or encoded."""

from __future__ import annotations

from fractions import Fraction

from av.audio.stream import AudioStream

from server.camera.audio.encoder import AudioEncoder
from server.camera.audio.frames import AudioFramer, EncodedAudioFrame, Packet
from server.camera.audio.passthrough import AudioPassthrough, is_compatible
from server.media.audio.audio_format import AudioFormat
from server.media.audio.opus import packet_samples


def select_framer(stream: AudioStream, form: AudioFormat, kbps: int) -> AudioFramer:
    """Pass through audio of the site's format, encode all other."""
    if not is_compatible(stream, form):
        return AudioEncoder(form, kbps)
    return AudioPassthrough(form) if form.coding == "aac" else _ByItsFirst(form, kbps)


class _ByItsFirst:
    """Opus says only packet by packet how long its frames are: the first one decides for all."""

    def __init__(self, form: AudioFormat, kbps: int) -> None:
        self._form, self._kbps = form, kbps
        self._way: AudioFramer | None = None

    def take(self, packet: Packet, at: Fraction) -> list[EncodedAudioFrame]:
        """Return what becomes whole by a packet."""
        if self._way is None:
            passes = packet_samples(bytes(packet)) == self._form.samples
            self._way = AudioPassthrough(self._form) if passes else AudioEncoder(self._form, self._kbps)
        return self._way.take(packet, at)
