"""Encodes audio of any format to the site's."""

from __future__ import annotations

import logging
from fractions import Fraction

import av
import numpy as np
from av.audio.codeccontext import AudioCodecContext
from av.audio.frame import AudioFrame
from av.audio.resampler import AudioResampler
from numpy.typing import NDArray

from server.camera.audio.frames import EncodedAudioFrame, Packet
from server.media.audio.audio_format import AudioFormat
from server.system.errors import reason_of

log = logging.getLogger(__name__)

_MAX_SILENCE_S = 10
"""Seconds of a gap up to which silence is encoded; frames of a longer one are left out."""
_DECODER_DELAY = {"aac": 0, "opus": 312}
"""Samples that a decoder is behind the encoder, beyond whole frames (libopus: 6.5 ms at 48 kHz)."""
_MAX_DRIFT_S = 0.02
"""Audio further than this from its due position, in seconds, is moved there."""


class AudioEncoder:
    """Decodes, resamples and encodes audio. Gaps become silence; overlapping packets are dropped."""

    def __init__(self, audio_format: AudioFormat, kbps: int) -> None:
        self._rate, self._frame_samples, self._decoder_delay = (
            audio_format.rate,
            audio_format.samples,
            _DECODER_DELAY[audio_format.coding],
        )
        self._layout = "mono" if audio_format.channels == 1 else "stereo"
        self._format = "fltp" if audio_format.coding == "aac" else "flt"
        self._resampler = self._new_resampler()
        self._has_warned = False
        """Whether an audio format that cannot be converted was logged."""
        self._input_format: tuple[str, str, int] | None = None
        """The resampler's input: format, layout, rate."""
        self._encoder = self._new_encoder(audio_format, kbps)
        self._samples: NDArray[np.float32] = np.zeros((audio_format.channels, 0), dtype=np.float32)
        """``(channels, samples)`` that do not fill a frame yet."""
        self._first: int | None = None
        """The sample number of the first one."""
        self._overlap = 0
        """Samples to drop from the next input, which overlaps."""

    def take(self, packet: Packet, at: Fraction) -> list[EncodedAudioFrame]:
        """Return the frames that the packet completes."""
        if packet.pts is None or packet.time_base is None:
            return []
        shift = at - packet.pts * packet.time_base
        try:
            decoded = [frame for frame in packet.decode() if isinstance(frame, AudioFrame)]
        except av.error.FFmpegError as error:
            log.debug("audio that cannot be decoded: %s", error)
            return []
        try:
            for frame in decoded:
                if frame.pts is not None and frame.time_base is not None:
                    self._seek(
                        round((frame.pts * frame.time_base + shift) * self._rate) - self._decoder_delay
                    )
                self._append(frame)
        except av.error.FFmpegError as error:
            if not self._has_warned:  # later packets have the same format
                log.warning(
                    "audio of %s at %d Hz cannot be converted: %s",
                    *(self._input_format or ())[1:],
                    reason_of(error),
                )
            self._has_warned = True
        return self._encode_full_frames()

    def _seek(self, at: int) -> None:
        """Continue at sample number ``at``, unless the position is nearly that already."""
        if self._first is None or at > self._first + _MAX_SILENCE_S * self._rate:
            self._first, self._samples = (
                max(0, at) // self._frame_samples * self._frame_samples,
                self._samples[:, :0],
            )
        ahead = at - (self._first + self._samples.shape[1])
        if abs(ahead) <= _MAX_DRIFT_S * self._rate and self._samples.shape[1]:
            return
        self._resampler = self._new_resampler()
        self._overlap = max(0, -ahead)
        self._samples = np.pad(self._samples, ((0, 0), (0, max(0, ahead))))

    def _append(self, frame: AudioFrame) -> None:
        input_format = frame.format.name, frame.layout.name, frame.sample_rate
        if input_format != self._input_format:  # the source's settings may change during a connection
            self._input_format, self._resampler = input_format, self._new_resampler()
        for out in self._resampler.resample(frame):
            samples = out.to_ndarray()[:, self._overlap :]
            self._overlap -= out.samples - samples.shape[1]
            self._samples = np.concatenate((self._samples, samples), axis=1)

    def _encode_full_frames(self) -> list[EncodedAudioFrame]:
        frames: list[EncodedAudioFrame] = []
        while self._first is not None and self._samples.shape[1] >= self._frame_samples:
            samples = np.ascontiguousarray(self._samples[:, : self._frame_samples])
            frame = AudioFrame.from_ndarray(*self._as_encoder_input(samples), layout=self._layout)
            frame.sample_rate, frame.pts, frame.time_base = self._rate, self._first, Fraction(1, self._rate)
            for packet in self._encoder.encode(frame):
                # Time stamps include the look-ahead: AAC's first frame precedes the first sample.
                number = -1 if packet.pts is None else round(packet.pts / self._frame_samples)
                if number >= 0:
                    frames.append(EncodedAudioFrame(number, bytes(packet)))
            self._samples, self._first = (
                self._samples[:, self._frame_samples :],
                self._first + self._frame_samples,
            )
        return frames

    def _new_resampler(self) -> AudioResampler:
        return AudioResampler(format="fltp", layout=self._layout, rate=self._rate)

    def _as_encoder_input(self, samples: NDArray[np.float32]) -> tuple[NDArray[np.float32], str]:
        """Return samples ``(channels, samples)`` in the encoder's sample format, with that format's name."""
        if self._format == "fltp":
            return samples, "fltp"
        return np.ascontiguousarray(samples.T).reshape(1, -1), "flt"

    def _new_encoder(self, audio_format: AudioFormat, kbps: int) -> AudioCodecContext:
        encoder = av.CodecContext.create({"aac": "aac", "opus": "libopus"}[audio_format.coding], "w")
        assert isinstance(encoder, AudioCodecContext)  # noqa: S101 — for mypy
        encoder.sample_rate, encoder.layout, encoder.format = audio_format.rate, self._layout, self._format
        encoder.time_base = Fraction(1, audio_format.rate)
        encoder.bit_rate = kbps * 1000
        encoder.open()
        return encoder
