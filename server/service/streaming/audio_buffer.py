"""The site's newest audio frames by number, and which of them belong to which pulses."""

from __future__ import annotations

from collections import OrderedDict

from server.media.audio.audio_chunk import AudioChunk
from server.media.audio.audio_format import AudioFormat
from server.messaging.messages import AudioHeader
from server.service.streaming.gapless_timeline import LONGEST_GAP_S

_LATE_S = 0.5
"""How long a camera's own stream, which is not delayed, waits for audio before it inserts silence."""
_RESTART_S = 10
"""When the pulse number falls by more, the pulses have started again."""


class AudioBuffer:
    """Keeps the last ``seconds`` of a site's audio."""

    def __init__(self, audio_format: AudioFormat, fps: float, seconds: float) -> None:
        self.format = audio_format
        self.fps = fps
        self._max_frames = round(seconds * audio_format.rate / audio_format.samples)
        self._frames: OrderedDict[int, bytes] = OrderedDict()
        self._silence = audio_format.silence

    def put(self, head: AudioHeader, payload: bytes) -> None:
        """Store consecutive frames.

        Raises:
            ValueError: the header does not fit the payload.
        """
        if sum(head.sizes) != len(payload):
            raise ValueError(f"{len(payload)} bytes of audio, but frames of {sum(head.sizes)}")
        at = 0
        for number, size in enumerate(head.sizes, start=head.first):
            self._frames.pop(number, None)  # a number that is sent again becomes the newest
            self._frames[number] = payload[at : at + size]
            at += size
        while len(self._frames) > self._max_frames:
            self._frames.popitem(last=False)

    def audio_between(self, first: int, until: int) -> AudioChunk:
        """Return the audio of the pulses ``first … until - 1``; missing frames are silent."""
        audio_format, fps = self.format, self.fps
        return self._audio(audio_format.frame_at(first, fps), audio_format.frame_at(until, fps))

    def _audio(self, begin: int, end: int) -> AudioChunk:
        frames = tuple(self._frames.get(number, self._silence) for number in range(begin, end))
        return AudioChunk(begin, frames, self.format)

    @property
    def max_late_frames(self) -> int:
        """Frames that audio may be late by before silence takes its place."""
        return round(_LATE_S * self.format.rate / self.format.samples)

    def get(self, number: int) -> bytes | None:
        """Return a frame; None if it has not arrived or is no longer kept."""
        return self._frames.get(number)

    def audio_so_far(self, begin: int, end: int, silent_before: int) -> AudioChunk:
        """Return frames from ``begin`` to the first missing one; before ``silent_before`` it is silence."""
        at = begin
        while at < end and (at in self._frames or at < silent_before):
            at += 1
        return self._audio(begin, at)


class AudioFollower:
    """The audio of a stream that shows frames as they arrive: gapless, with little delay.

    ``begin`` is the number of its first frame; None: the frame of the first picture.
    """

    def __init__(self, buffer: AudioBuffer, begin: int | None = None) -> None:
        self._buffer = buffer
        self._next = begin

    def next_audio(self, first: int, until: int) -> AudioChunk:
        """Return the next audio frames, as the pulses ``first … until - 1`` are shown."""
        buffer = self._buffer
        audio_format, fps = buffer.format, buffer.fps
        begin, end = audio_format.frame_at(first, fps), audio_format.frame_at(until, fps)
        # A gap that the pictures do not fill either, as after suspend, is not filled with hours of silence.
        second = audio_format.rate / audio_format.samples
        if self._next is None or not -_RESTART_S * second <= begin - self._next <= LONGEST_GAP_S * second:
            self._next = begin
        silent_before = end - buffer.max_late_frames
        audio = buffer.audio_so_far(self._next, end, silent_before)
        self._next += len(audio.frames)
        return audio
