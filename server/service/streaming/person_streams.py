"""Everybody's streams, one each, from the first decision about somebody until nobody knows them any more."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.hls_segmenter import HlsSegmenter
from server.service.streaming.presence import Presence
from server.service.streaming.spliced_stream import GopAssembler, SplicedStream

PresenceLookup = Callable[[int], Presence]
"""Says what the newest GOP shows of a person."""


def always_present(number: int) -> Presence:
    """Return that the best view is shown, of anybody."""
    del number
    return Presence.PRESENT


class PersonStreams:
    """Shows every person by the camera that is chosen for them; ``presence`` says whether they are shown."""

    def __init__(
        self, new_stream: Callable[[], SplicedStream], presence: PresenceLookup = always_present
    ) -> None:
        self._new_stream, self._presence = new_stream, presence
        self._streams: dict[int, SplicedStream] = {}
        self._gone: dict[int, SplicedStream] = {}
        """Those whose stream has ended a moment ago: players still fetch its end."""
        self.channels: dict[int, Broadcaster] = {}

    def show(self, cameras: Mapping[int, str | None], merged: Mapping[int, int], gop: GopAssembler) -> None:
        """Pass everybody's chosen GOP on to those who watch it."""
        for number, camera in cameras.items():
            if number not in self._streams:
                stream = self._streams[number] = self._new_stream()
                self.channels[number] = stream.channel
            self._streams[number].show(camera, gop, self._presence(number))
        # The streams of numbers that turned out to be another's go on with that person.
        for lost, kept in merged.items():
            if lost in self._streams and kept in cameras and lost not in cameras:
                self._streams[lost].show(cameras[kept], gop, self._presence(kept))

    def forget(self, known: Collection[int]) -> None:
        """End the streams of those whom nobody remembers any more."""
        for number in [it for it in self.channels if it not in known]:
            del self.channels[number]
            self._gone[number] = self._streams.pop(number)
            self._gone[number].close()

    def forget_ended_before(self, pulse: int) -> None:
        """Let go of what is left of streams that ended before a pulse."""
        for number in [it for it, stream in self._gone.items() if stream.reel.until < pulse]:
            del self._gone[number]

    def watched(self, number: int) -> int:
        """Return how many watch a person's stream."""
        channel = self.channels.get(number)
        return 0 if channel is None else channel.viewers

    @property
    def viewers(self) -> int:
        """How many watch, all streams together."""
        return sum(channel.viewers for channel in self.channels.values())

    def reel(self, number: int) -> HlsSegmenter | None:
        """Return the newest segments of a person's stream, for a while even when it has ended."""
        stream = self._streams.get(number) or self._gone.get(number)
        return None if stream is None else stream.reel

    def close(self) -> None:
        """End all streams."""
        for stream in self._streams.values():
            stream.close()
