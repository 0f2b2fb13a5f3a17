"""A stream that is packed for itself: what has been sent is counted, and nothing has to be stretched."""

from __future__ import annotations

from collections.abc import Sequence

from server.media.audio.audio_chunk import Heard
from server.media.containers.mpegts import Counters, packets, sound_packets
from server.media.picture import Picture
from server.service.streaming.media_chunk import Footage


class Tally:
    """Counts the packets of one stream, so that each piece of it goes on where the one before ended."""

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._tables = self._packets = self._sound_packets = 0

    def footage(self, pictures: Sequence[Picture], heard: Heard | None, *, fills: bool = False) -> Footage:
        """Give the next pictures, at least one, with what is heard meanwhile."""
        counters = Counters(self._tables, self._packets, self._sound_packets, whole=False)
        self._sound_packets += 0 if heard is None else sound_packets(heard)
        self._tables += pictures[0].key
        self._packets += sum(packets(picture) for picture in pictures)
        return Footage(pictures, self._fps, counters, fills=fills, heard=heard)
