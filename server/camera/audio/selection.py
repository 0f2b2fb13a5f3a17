"""The choice between audio passthrough and encoding."""

from __future__ import annotations

from fractions import Fraction

from av.audio.stream import AudioStream

from server.camera.audio.encoder import AudioEncoder
from server.camera.audio.frames import AudioFramer, EncodedAudioFrame, Packet
from server.camera.audio.passthrough import AudioPassthrough, is_compatible
from server.media.audio.audio_format import AudioFormat
from server.media.audio.opus import packet_samples


def select_framer(stream: AudioStream, audio_format: AudioFormat, kbps: int) -> AudioFramer:
    """Return a passthrough for audio of the site's format, an encoder for other audio."""
    if not is_compatible(stream, audio_format):
        return AudioEncoder(audio_format, kbps)
    return AudioPassthrough(audio_format) if audio_format.coding == "aac" else _OpusFramer(audio_format, kbps)


class _OpusFramer:
    """Chooses by the first packet: Opus streams do not declare the length of their frames."""

    def __init__(self, audio_format: AudioFormat, kbps: int) -> None:
        self._format, self._kbps = audio_format, kbps
        self._framer: AudioFramer | None = None

    def take(self, packet: Packet, at: Fraction) -> list[EncodedAudioFrame]:
        """Return the frames completed by a packet."""
        if self._framer is None:
            is_compatible_length = packet_samples(bytes(packet)) == self._format.samples
            self._framer = (
                AudioPassthrough(self._format)
                if is_compatible_length
                else AudioEncoder(self._format, self._kbps)
            )
        return self._framer.take(packet, at)
