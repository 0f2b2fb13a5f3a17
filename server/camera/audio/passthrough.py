"""Sound that is as the site's is to be: passed on as it is, byte for byte."""

from __future__ import annotations

from fractions import Fraction

from av.audio.stream import AudioStream

from server.camera.audio.frames import EncodedAudioFrame, Packet
from server.media.audio.audio_format import OPUS_RATE, AudioFormat
from server.media.audio.opus import packet_samples

_OFF = Fraction(3, 4)
"""Frames by which one may be away from its place before it is moved: times in files are rounded."""
_EXTENSION = b"\x56\xe5"
"""Begins what says that there is more to decode than low complexity (ISO/IEC 14496-3, 1.6.6.1)."""
_PRESENT = 0x80


def is_compatible(stream: AudioStream, form: AudioFormat) -> bool:
    """Return whether a decoder that was told the site's format decodes these packets."""
    context = stream.codec_context
    if context.name in {"opus", "libopus"} and form.coding == "opus":
        return (context.sample_rate, context.layout.nb_channels) == (OPUS_RATE, form.channels)
    if context.name != "aac" or form.coding != "aac" or context.extradata is None:
        return False
    told, more = context.extradata[:2], context.extradata[2:]
    richer = more.startswith(_EXTENSION) and len(more) > 2 and bool(more[2] & _PRESENT)  # noqa: PLR2004
    return told == form.config and not richer


class AudioPassthrough:
    """Passes packets through; each gets the frame number nearest to its time."""

    def __init__(self, form: AudioFormat) -> None:
        self._form = form
        self._next: int | None = None

    def take(self, packet: Packet, at: Fraction) -> list[EncodedAudioFrame]:
        """Return the packet as a frame; nothing where its place is taken, or it is not as long as a frame."""
        data = bytes(packet)
        if self._form.coding == "opus" and packet_samples(data) != self._form.samples:
            return []
        place = at * self._form.rate / self._form.samples
        number = round(place)
        if self._next is not None and abs(place - self._next) < _OFF:
            number = self._next
        if number < (self._next or 0):
            return []
        self._next = number + 1
        return [EncodedAudioFrame(number, data)]
