"""Pictures of a stream in a row, packed once however many watch them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from server.media.audio.audio_chunk import Heard
from server.media.containers.mpegts import Counters, pack, packets, sound_packets
from server.media.picture import Picture


class MediaChunk:
    """Consecutive pictures as a piece of a stream (:class:`server.service.streaming.broadcaster.Piece`).

    Each form is made when it is first asked for, and then shared by all who are given this piece.
    """

    def __init__(
        self,
        pictures: Sequence[Picture],
        fps: float,
        counters: Counters,
        *,
        fills: bool = False,
        heard: Heard | None = None,
        silent: bool = False,
    ) -> None:
        self.pictures = tuple(pictures)
        self._fps, self._counters = fps, counters
        self.start = self.pictures[0].key
        self.fills = fills
        self.heard = heard
        """What is to be heard meanwhile; None at a site without sound."""
        self.silent = silent
        """Whether nothing may be heard meanwhile, by who joins it with sound of their own."""

    @property
    def first(self) -> int:
        """The first pulse."""
        return self.pictures[0].pulse

    @property
    def until(self) -> int:
        """The first pulse after it."""
        return self.pictures[-1].until

    @cached_property
    def data(self) -> bytes:
        """The pictures as fragments of MP4."""
        return b"".join(picture.fragment for picture in self.pictures)

    @property
    def sound(self) -> bytes:
        """What is to be heard meanwhile as a fragment of MP4; nothing at a site without sound."""
        return b"" if self.heard is None else self.heard.fragment

    @cached_property
    def with_sound(self) -> bytes:
        """The pictures as fragments of MP4, behind what is to be heard with them."""
        return self.sound + self.data

    @cached_property
    def ts(self) -> bytes:
        """The pictures as an MPEG transport stream."""
        return pack(self.pictures, self._fps, self._counters, self.heard)


class TsContinuity:
    """Counts the packets of one stream, so that each piece of it goes on where the one before ended."""

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._tables = self._packets = self._sound_packets = 0

    def footage(self, pictures: Sequence[Picture], heard: Heard | None, *, fills: bool = False) -> MediaChunk:
        """Give the next pictures, at least one, with what is heard meanwhile."""
        counters = Counters(self._tables, self._packets, self._sound_packets, whole=False)
        self._sound_packets += 0 if heard is None else sound_packets(heard)
        self._tables += pictures[0].key
        self._packets += sum(packets(picture) for picture in pictures)
        return MediaChunk(pictures, self._fps, counters, fills=fills, heard=heard)
