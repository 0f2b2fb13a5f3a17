"""The best-view stream of every person, from the first decision about them until they are forgotten."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.hls_segmenter import HlsSegmenter
from server.service.streaming.presence import ScopedPicture
from server.service.streaming.spliced_stream import GopAssembler, SplicedStream

ScopedPictureLookup = Callable[[int], ScopedPicture]
"""Returns what the newest GOP may show of a person."""


def always_shown(number: int) -> ScopedPicture:
    """Return that the best view is shown, whoever it is."""
    del number
    return ScopedPicture.SHOWN


class PersonStreams:
    """Shows every person from their chosen camera; ``picture_of`` returns whether they may be shown."""

    def __init__(
        self, new_stream: Callable[[], SplicedStream], picture_of: ScopedPictureLookup = always_shown
    ) -> None:
        self._new_stream, self._picture_of = new_stream, picture_of
        self._streams: dict[int, SplicedStream] = {}
        self._ended: dict[int, SplicedStream] = {}
        """Recently ended streams: HLS players still fetch their last segments."""
        self.broadcasters: dict[int, Broadcaster] = {}

    def show(self, cameras: Mapping[int, str | None], merged: Mapping[int, int], gop: GopAssembler) -> None:
        """Publish a GOP of every person's chosen camera."""
        for number, camera in cameras.items():
            self.begin(number)
            self._streams[number].show(camera, gop, self._picture_of(number))
        # The stream of a number that was merged into another continues with that person.
        for lost, kept in merged.items():
            if lost in self._streams and kept in cameras and lost not in cameras:
                self._streams[lost].show(cameras[kept], gop, self._picture_of(kept))

    def begin(self, number: int) -> Broadcaster:
        """Return a person's stream, which exists from now on."""
        if number not in self._streams:
            stream = self._streams[number] = self._new_stream()
            self.broadcasters[number] = stream.broadcaster
        return self.broadcasters[number]

    def forget(self, known: Collection[int]) -> None:
        """End the streams of persons that are not known any more."""
        for number in [number for number in self.broadcasters if number not in known]:
            del self.broadcasters[number]
            self._ended[number] = self._streams.pop(number)
            self._ended[number].close()

    def forget_ended_before(self, pulse: int) -> None:
        """Drop the segments of streams that ended before a pulse."""
        for number in [number for number, stream in self._ended.items() if stream.segmenter.until < pulse]:
            del self._ended[number]

    def viewers_of(self, number: int) -> int:
        """Return the number of viewers of a person's stream."""
        broadcaster = self.broadcasters.get(number)
        return 0 if broadcaster is None else broadcaster.viewers

    @property
    def viewers(self) -> int:
        """The number of viewers of all streams."""
        return sum(broadcaster.viewers for broadcaster in self.broadcasters.values())

    def segmenter(self, number: int) -> HlsSegmenter | None:
        """Return the newest segments of a person's stream, for a while even when it has ended."""
        stream = self._streams.get(number) or self._ended.get(number)
        return None if stream is None else stream.segmenter

    def close(self) -> None:
        """End all streams."""
        for stream in self._streams.values():
            stream.close()
