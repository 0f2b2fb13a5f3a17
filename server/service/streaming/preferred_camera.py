"""A camera that somebody prefers: it is shown while it sees the person, and else whichever sees them best.

It is decided by what everybody is told of a GOP, and of the one before, so that whoever reads the events
knows which camera's pictures come: it has the person in more than half of the frames of both. A glimpse is
not worth two cuts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.person_streams import PresenceLookup, always_present
from server.service.streaming.presence import Boxes
from server.service.streaming.spliced_stream import GopAssembler, SplicedStream
from server.service.view_selection.decider import GopDecision


class PreferredCameraStreams:
    """The streams that prefer a camera, each from the first viewer to the last.

    ``presence`` says whether a person is shown.
    """

    def __init__(
        self, new_stream: Callable[[], SplicedStream], presence: PresenceLookup = always_present
    ) -> None:
        self._new_stream, self._presence = new_stream, presence
        self._streams: dict[tuple[int, str], SplicedStream] = {}
        self._before: Boxes | None = None
        self._now: tuple[GopDecision, GopAssembler] | None = None

    def channel(self, number: int, camera: str) -> Broadcaster:
        """Give the stream of a person in which a camera is preferred; who asks joins it at once."""
        stream = self._streams.get((number, camera))
        if stream is None:
            stream = self._streams[number, camera] = self._new_stream()
            if self._now is not None:
                self._show(stream, number, camera)  # or there would be nothing to see before the next GOP
        return stream.channel

    def show(self, decision: GopDecision, gop: GopAssembler) -> None:
        """Pass a GOP on to those who watch; a stream that nobody watches is given up."""
        self._before = None if self._now is None else self._now[0].boxes
        self._now = (decision, gop)
        for key in [key for key, stream in self._streams.items() if not stream.channel.viewers]:
            self._streams.pop(key).close()
        for (number, camera), stream in self._streams.items():
            self._show(stream, number, camera)

    def forget(self, known: Collection[int]) -> None:
        """End the streams of those whom nobody remembers any more."""
        for key in [key for key in self._streams if key[0] not in known]:
            self._streams.pop(key).close()

    @property
    def viewers(self) -> int:
        """How many are watching."""
        return sum(stream.channel.viewers for stream in self._streams.values())

    def close(self) -> None:
        """End all streams."""
        for stream in self._streams.values():
            stream.close()

    def _show(self, stream: SplicedStream, number: int, camera: str) -> None:
        assert self._now is not None  # noqa: S101 — who calls has looked
        decision, gop = self._now
        person = decision.merged.get(number, number)
        best = next((it.camera for it in decision.choices if it.number == person), None)
        seen = {person, *(lost for lost, kept in decision.merged.items() if kept == person)}
        steady = _sees(decision.boxes, camera, seen) and (
            self._before is None or _sees(self._before, camera, seen)
        )
        stream.show(camera if steady else best, gop, self._presence(person))


def _sees(boxes: Boxes, camera: str, numbers: Collection[int]) -> bool:
    """Tell whether a camera sees somebody, by any of their numbers, in more than half of a GOP's frames."""
    frames = boxes.get(camera, ())
    return 2 * sum(any(box[0] in numbers for box in frame) for frame in frames) > len(frames)
