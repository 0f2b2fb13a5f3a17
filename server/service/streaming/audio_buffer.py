"""The site's sound: its newest frames by number, and which of them belong to some pulses."""

from __future__ import annotations

from collections import OrderedDict

from server.media.audio.audio_chunk import Heard
from server.media.audio.audio_format import SoundFormat
from server.messaging.messages import AudioHeader
from server.service.streaming.gapless_timeline import LONGEST_GAP_S

_PATIENCE_S = 0.5
"""How long a camera's own stream, which is behind nobody, waits for sound before it has silence instead."""
_ANEW_S = 10
"""Pulses that go back by more have begun anew."""


class AudioBuffer:
    """Keeps the last ``seconds`` of a site's sound."""

    def __init__(self, form: SoundFormat, fps: float, seconds: float) -> None:
        self.format = form
        self.fps = fps
        self._most = round(seconds * form.rate / form.samples)
        self._frames: OrderedDict[int, bytes] = OrderedDict()
        self._silence = form.silence

    def put(self, head: AudioHeader, payload: bytes) -> None:
        """Shelve consecutive frames.

        Raises:
            ValueError: the head does not fit the payload.
        """
        if sum(head.sizes) != len(payload):
            raise ValueError(f"{len(payload)} bytes of sound, but frames of {sum(head.sizes)}")
        at = 0
        for number, size in enumerate(head.sizes, start=head.first):
            self._frames.pop(number, None)  # what comes anew is the newest
            self._frames[number] = payload[at : at + size]
            at += size
        while len(self._frames) > self._most:
            self._frames.popitem(last=False)

    def between(self, first: int, until: int) -> Heard:
        """Give the sound of the pulses ``first … until - 1``: from the frame on that sounds at ``first``."""
        form, fps = self.format, self.fps
        return self._heard(form.frame_at(first, fps), form.frame_at(until, fps))

    def _heard(self, begin: int, end: int) -> Heard:
        frames = tuple(self._frames.get(number, self._silence) for number in range(begin, end))
        return Heard(begin, frames, self.format)

    @property
    def patience(self) -> int:
        """Frames that sound may be late by before it is taken to be silent."""
        return round(_PATIENCE_S * self.format.rate / self.format.samples)

    def get(self, number: int) -> bytes | None:
        """Give a frame; None where it has not come, or is not kept any more."""
        return self._frames.get(number)

    def come(self, begin: int, end: int, late: int) -> Heard:
        """Give frames from ``begin`` on up to one that may still come: neither here nor before ``late``."""
        at = begin
        while at < end and (at in self._frames or at < late):
            at += 1
        return self._heard(begin, at)


class AudioFollower:
    """The sound of a stream that shows pictures as they come: at most a little behind them, no hole in it.

    ``begin`` is the number of its first frame; None: what sounds at the first picture.
    """

    def __init__(self, shelf: AudioBuffer, begin: int | None = None) -> None:
        self._shelf = shelf
        self._next = begin

    def beside(self, first: int, until: int) -> Heard:
        """Give what is to be heard next, now that the pulses ``first … until - 1`` are shown."""
        shelf = self._shelf
        form, fps = shelf.format, shelf.fps
        begin, end = form.frame_at(first, fps), form.frame_at(until, fps)
        # A hole that the pictures leave one too, as of a machine that slept, is no silence of hours.
        second = form.rate / form.samples
        if self._next is None or not -_ANEW_S * second <= begin - self._next <= LONGEST_GAP_S * second:
            self._next = begin
        late = end - shelf.patience
        heard = shelf.come(self._next, end, late)
        self._next += len(heard.frames)
        return heard
