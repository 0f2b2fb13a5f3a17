"""Sound of any kind, encoded once to what the site's is."""

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

log = logging.getLogger(__name__)

_LONG_S = 10
"""A longer silence is not encoded: its frames are left out."""
_AHEAD = {"aac": 0, "opus": 312}
"""Samples that a decoder is behind the encoder, beyond whole frames (libopus: 6.5 ms at 48 kHz)."""
_OFF_S = 0.02
"""Sound that is this far away from its place is moved there."""


class AudioEncoder:
    """Decodes, resamples and encodes audio. Gaps become silence; overlapping packets are dropped."""

    def __init__(self, form: AudioFormat, kbps: int) -> None:
        self._rate, self._each, self._ahead = form.rate, form.samples, _AHEAD[form.coding]
        self._layout = "mono" if form.channels == 1 else "stereo"
        self._format = "fltp" if form.coding == "aac" else "flt"
        self._resampler = self._new_resampler()
        self._told = False
        """That something cannot be converted."""
        self._heard: tuple[str, str, int] | None = None
        """What the resampler is given: format, layout, rate. It takes nothing else."""
        self._encoder = self._new_encoder(form, kbps)
        self._samples: NDArray[np.float32] = np.zeros((form.channels, 0), dtype=np.float32)
        """``(channels, samples)`` that are no whole frame yet."""
        self._first: int | None = None
        """The sample number of the first of them."""
        self._too_many = 0
        """Samples that are to be left out of what comes."""

    def take(self, packet: Packet, at: Fraction) -> list[EncodedAudioFrame]:
        """Return the frames that have become whole."""
        if packet.pts is None or packet.time_base is None:
            return []
        shift = at - packet.pts * packet.time_base
        try:
            heard = [it for it in packet.decode() if isinstance(it, AudioFrame)]
        except av.error.FFmpegError as error:
            log.debug("sound that cannot be decoded: %s", error)
            return []
        try:
            for frame in heard:
                if frame.pts is not None and frame.time_base is not None:
                    self._place(round((frame.pts * frame.time_base + shift) * self._rate) - self._ahead)
                self._append(frame)
        except av.error.FFmpegError as error:
            if not self._told:  # it is the same of all that follows
                log.warning(
                    "sound of %s at %d Hz cannot be converted: %s", *(self._heard or ())[1:], error.strerror
                )
            self._told = True
        return self._encoded()

    def _place(self, at: int) -> None:
        """Make sample number ``at`` the next one, if it is not nearly so."""
        if self._first is None or at > self._first + _LONG_S * self._rate:
            self._first, self._samples = max(0, at) // self._each * self._each, self._samples[:, :0]
        ahead = at - (self._first + self._samples.shape[1])
        if abs(ahead) <= _OFF_S * self._rate and self._samples.shape[1]:
            return
        self._resampler = self._new_resampler()
        self._too_many = max(0, -ahead)
        self._samples = np.pad(self._samples, ((0, 0), (0, max(0, ahead))))

    def _append(self, frame: AudioFrame) -> None:
        heard = frame.format.name, frame.layout.name, frame.sample_rate
        if heard != self._heard:  # an encoder's settings may change while it sends
            self._heard, self._resampler = heard, self._new_resampler()
        for out in self._resampler.resample(frame):
            samples = out.to_ndarray()[:, self._too_many :]
            self._too_many -= out.samples - samples.shape[1]
            self._samples = np.concatenate((self._samples, samples), axis=1)

    def _encoded(self) -> list[EncodedAudioFrame]:
        found: list[EncodedAudioFrame] = []
        while self._first is not None and self._samples.shape[1] >= self._each:
            samples = np.ascontiguousarray(self._samples[:, : self._each])
            frame = AudioFrame.from_ndarray(*self._laid_out(samples), layout=self._layout)
            frame.sample_rate, frame.pts, frame.time_base = self._rate, self._first, Fraction(1, self._rate)
            for packet in self._encoder.encode(frame):
                # Its time says what the encoder looks ahead: of AAC the first is all before the first sample.
                number = -1 if packet.pts is None else round(packet.pts / self._each)
                if number >= 0:
                    found.append(EncodedAudioFrame(number, bytes(packet)))
            self._samples, self._first = self._samples[:, self._each :], self._first + self._each
        return found

    def _new_resampler(self) -> AudioResampler:
        return AudioResampler(format="fltp", layout=self._layout, rate=self._rate)

    def _laid_out(self, samples: NDArray[np.float32]) -> tuple[NDArray[np.float32], str]:
        """Return samples ``(channels, samples)`` as the encoder likes them, with its name for that."""
        if self._format == "fltp":
            return samples, "fltp"
        return np.ascontiguousarray(samples.T).reshape(1, -1), "flt"

    def _new_encoder(self, form: AudioFormat, kbps: int) -> AudioCodecContext:
        encoder = av.CodecContext.create({"aac": "aac", "opus": "libopus"}[form.coding], "w")
        assert isinstance(encoder, AudioCodecContext)  # noqa: S101 — tells mypy what they are
        encoder.sample_rate, encoder.layout, encoder.format = form.rate, self._layout, self._format
        encoder.time_base = Fraction(1, form.rate)
        encoder.bit_rate = kbps * 1000
        encoder.open()
        return encoder
