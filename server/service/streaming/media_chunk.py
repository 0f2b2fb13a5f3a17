"""Consecutive pictures of a stream, packed once as MP4 or MPEG-TS however many viewers receive them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from server.media.audio.audio_chunk import AudioChunk
from server.media.containers.mpegts import ContinuityCounters, count_audio_packets, count_packets, pack
from server.media.picture import EncodedPicture


class MediaChunk:
    """Consecutive pictures with their audio, as a :class:`~server.service.streaming.subscriber_queue.Chunk`.

    Each container format is packed when it is first needed and then shared by all subscribers.
    """

    def __init__(
        self,
        pictures: Sequence[EncodedPicture],
        fps: float,
        counters: ContinuityCounters,
        *,
        is_filler: bool = False,
        audio: AudioChunk | None = None,
        is_muted: bool = False,
    ) -> None:
        self.pictures = tuple(pictures)
        self._fps, self._counters = fps, counters
        self.random_access = self.pictures[0].key
        self.is_filler = is_filler
        self.audio = audio
        """The audio of the same time; None at a site without audio."""
        self.is_muted = is_muted
        """Whether an output that adds audio of its own must be silent, too."""

    @property
    def first(self) -> int:
        """The first pulse."""
        return self.pictures[0].pulse

    @property
    def until(self) -> int:
        """The pulse after the last."""
        return self.pictures[-1].until

    @cached_property
    def data(self) -> bytes:
        """The pictures as MP4 fragments."""
        return b"".join(picture.fragment for picture in self.pictures)

    @property
    def audio_fragment(self) -> bytes:
        """The audio as one MP4 fragment; empty at a site without audio."""
        return b"" if self.audio is None else self.audio.fragment

    @cached_property
    def data_with_audio(self) -> bytes:
        """The audio fragment, then the fragments of the pictures."""
        return self.audio_fragment + self.data

    @cached_property
    def mpegts(self) -> bytes:
        """The pictures and the audio as an MPEG transport stream."""
        return pack(self.pictures, self._fps, self._counters, self.audio)


class TsContinuity:
    """Counts one stream's MPEG-TS packets, so that the continuity counters continue from chunk to chunk.

    For streams that share no chunks: they need no stuffing to align the counters.
    """

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._tables = self._packets = self._audio_packets = 0

    def chunk(
        self, pictures: Sequence[EncodedPicture], audio: AudioChunk | None, *, is_filler: bool = False
    ) -> MediaChunk:
        """Return the next pictures, at least one, with their audio as a chunk."""
        counters = ContinuityCounters(self._tables, self._packets, self._audio_packets, aligned=False)
        self._audio_packets += 0 if audio is None else count_audio_packets(audio)
        self._tables += pictures[0].key
        self._packets += sum(count_packets(picture) for picture in pictures)
        return MediaChunk(pictures, self._fps, counters, is_filler=is_filler, audio=audio)
