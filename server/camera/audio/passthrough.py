"""Passes audio of the site's format through byte for byte, and selects the encoder for other audio."""

from __future__ import annotations

from fractions import Fraction

from av.audio.stream import AudioStream

from server.camera.audio.encoder import AudioEncoder
from server.camera.audio.frames import AudioFramer, EncodedAudioFrame, Packet
from server.media.audio.audio_format import OPUS_RATE, AudioFormat
from server.media.audio.opus import packet_samples

_MAX_DRIFT = Fraction(3, 4)
"""Largest difference between a packet's time and the next frame number, in frames: times in files are
rounded."""
_EXTENSION = b"\x56\xe5"
"""Marks an extension beyond AAC low complexity (ISO/IEC 14496-3, 1.6.6.1)."""
_PRESENT = 0x80


def is_compatible(stream: AudioStream, audio_format: AudioFormat) -> bool:
    """Return whether a decoder set up for the site's format decodes this stream."""
    context = stream.codec_context
    if context.name in {"opus", "libopus"} and audio_format.coding == "opus":
        return (context.sample_rate, context.layout.nb_channels) == (OPUS_RATE, audio_format.channels)
    if context.name != "aac" or audio_format.coding != "aac" or context.extradata is None:
        return False
    config, extension = context.extradata[:2], context.extradata[2:]
    is_extended = extension.startswith(_EXTENSION) and len(extension) > 2 and bool(extension[2] & _PRESENT)  # noqa: PLR2004
    return config == audio_format.aac_config and not is_extended


class AudioPassthrough:
    """Passes packets through; each gets the frame number nearest to its time."""

    def __init__(self, audio_format: AudioFormat) -> None:
        self._format = audio_format
        self._next: int | None = None

    def take(self, packet: Packet, at: Fraction) -> list[EncodedAudioFrame]:
        """Return the packet as a frame; nothing if its number is used already or it is not one frame long."""
        data = bytes(packet)
        if self._format.coding == "opus" and packet_samples(data) != self._format.samples:
            return []
        position = at * self._format.rate / self._format.samples
        number = round(position)
        if self._next is not None and abs(position - self._next) < _MAX_DRIFT:
            number = self._next
        if number < (self._next or 0):
            return []
        self._next = number + 1
        return [EncodedAudioFrame(number, data)]


def select_framer(stream: AudioStream, audio_format: AudioFormat, kbps: int) -> AudioFramer:
    """Return a passthrough for audio of the site's format, an encoder for other audio."""
    if not is_compatible(stream, audio_format):
        return AudioEncoder(audio_format, kbps)
    return AudioPassthrough(audio_format) if audio_format.coding == "aac" else _OpusFramer(audio_format, kbps)


class _OpusFramer:
    """Passes through or encodes, by the first packet: Opus streams do not declare their frame length."""

    def __init__(self, audio_format: AudioFormat, kbps: int) -> None:
        self._format, self._kbps = audio_format, kbps
        self._framer: AudioFramer | None = None

    def take(self, packet: Packet, at: Fraction) -> list[EncodedAudioFrame]:
        """Return the frames that a packet completes."""
        if self._framer is None:
            is_compatible_length = packet_samples(bytes(packet)) == self._format.samples
            self._framer = (
                AudioPassthrough(self._format)
                if is_compatible_length
                else AudioEncoder(self._format, self._kbps)
            )
        return self._framer.take(packet, at)
