"""Best views in which the viewer prefers a camera: it is shown while it sees the person, else the best one.

The camera counts as seeing the person if it has a box of them in more than half of the frames of a GOP and of
the GOP before: a brief view is not worth two cuts. Only published decisions count, so a client that reads the
events can tell which camera is shown.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.person_streams import ScopedPictureLookup, always_shown
from server.service.streaming.presence import Boxes
from server.service.streaming.spliced_stream import GopAssembler, SplicedStream
from server.service.view_selection.decider import GopDecision


class PreferredCameraStreams:
    """The streams with a preferred camera, each from its first viewer to its last.

    ``picture_of`` returns whether a person may be shown.
    """

    def __init__(
        self, new_stream: Callable[[], SplicedStream], picture_of: ScopedPictureLookup = always_shown
    ) -> None:
        self._new_stream, self._picture_of = new_stream, picture_of
        self._streams: dict[tuple[int, str], SplicedStream] = {}
        self._previous_boxes: Boxes | None = None
        self._newest: tuple[GopDecision, GopAssembler] | None = None

    def broadcaster(self, number: int, camera: str) -> Broadcaster:
        """Return the stream of a person with a preferred camera; the caller subscribes to it at once."""
        stream = self._streams.get((number, camera))
        if stream is None:
            stream = self._streams[number, camera] = self._new_stream()
            if self._newest is not None:
                self._show(stream, number, camera)  # otherwise nothing is shown until the next GOP
        return stream.broadcaster

    def show(self, decision: GopDecision, gop: GopAssembler) -> None:
        """Publish a GOP in all streams; a stream without viewers ends."""
        self._previous_boxes = None if self._newest is None else self._newest[0].boxes
        self._newest = (decision, gop)
        for key in [key for key, stream in self._streams.items() if not stream.broadcaster.viewers]:
            self._streams.pop(key).close()
        for (number, camera), stream in self._streams.items():
            self._show(stream, number, camera)

    def forget(self, known: Collection[int]) -> None:
        """End the streams of persons that are not known any more."""
        for key in [key for key in self._streams if key[0] not in known]:
            self._streams.pop(key).close()

    @property
    def viewers(self) -> int:
        """The number of viewers of all streams."""
        return sum(stream.broadcaster.viewers for stream in self._streams.values())

    def close(self) -> None:
        """End all streams."""
        for stream in self._streams.values():
            stream.close()

    def _show(self, stream: SplicedStream, number: int, camera: str) -> None:
        assert self._newest is not None  # noqa: S101 — the callers check it
        decision, gop = self._newest
        person = decision.merged.get(number, number)
        best = next((choice.camera for choice in decision.choices if choice.number == person), None)
        numbers = {person, *(lost for lost, kept in decision.merged.items() if kept == person)}
        is_seen = _sees(decision.boxes, camera, numbers) and (
            self._previous_boxes is None or _sees(self._previous_boxes, camera, numbers)
        )
        stream.show(camera if is_seen else best, gop, self._picture_of(person))


def _sees(boxes: Boxes, camera: str, numbers: Collection[int]) -> bool:
    """Return whether a camera has a box of any of these numbers in more than half of a GOP's frames."""
    frames = boxes.get(camera, ())
    return 2 * sum(any(box[0] in numbers for box in frame) for frame in frames) > len(frames)
