"""Best views without look-ahead: every picture of the chosen camera as soon as it arrives, while watched.

The camera of a GOP is decided a moment before it begins. Where the decision is late, pictures wait for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from server.media.picture import EncodedPicture
from server.service.streaming.audio_buffer import AudioBuffer, AudioFollower
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.media_chunk import TsContinuity
from server.service.view_selection.delay_modes import ModeDecision

_LATE_S = 0.2
"""How late a picture may be beside other cameras' before it counts as missing, and is filled."""
_DECISIONS_KEPT = 8
"""Recent decisions, with which a new stream begins."""
_IDLE_DECISIONS = 3
"""Decisions without a viewer after which a stream ends: its first viewer may be about to subscribe."""


class PictureStream:
    """A stream that shows every picture as soon as it arrives."""

    def __init__(
        self,
        broadcaster: Broadcaster,
        timeline: GaplessTimeline,
        fps: float,
        audio_buffer: AudioBuffer | None = None,
    ) -> None:
        self.broadcaster = broadcaster
        self._timeline, self._ts = timeline, TsContinuity(fps)
        self._audio = None if audio_buffer is None else AudioFollower(audio_buffer)

    def push(self, picture: EncodedPicture) -> None:
        """Publish a picture, after the filler of a gap before it."""
        for shown in self._timeline.push(picture):
            self._publish([shown], is_filler=False)

    def fill(self, until: int) -> None:
        """Repeat the last picture, if there is one, up to a pulse."""
        self._publish(self._timeline.fill(until), is_filler=True)

    def _publish(self, pictures: list[EncodedPicture], *, is_filler: bool) -> None:
        if not pictures:
            return
        first, until = pictures[0].pulse, pictures[-1].until
        audio = None if self._audio is None else self._audio.next_audio(first, until)
        self.broadcaster.publish(self._ts.chunk(pictures, audio, is_filler=is_filler))


@dataclass(frozen=True, slots=True)
class _PlannedGop:
    """The camera of one GOP; None: the last camera goes on."""

    first: int
    until: int
    camera: str | None


class LivePersonStream:
    """One person's pictures, from the camera that is planned for each GOP; GOPs are shown in order."""

    def __init__(self, stream: PictureStream, buffers: Mapping[str, FrameBuffer], late_frames: int) -> None:
        self.stream, self._buffers, self._late_frames = stream, buffers, late_frames
        self._plan: deque[_PlannedGop] = deque()
        self._camera: str | None = None
        self._next = 0
        """The next pulse to show."""
        self.idle_decisions = 0

    def plan(self, first: int, until: int, camera: str | None) -> None:
        """Add the camera of the next GOP."""
        if self._plan and first < self._plan[-1].first:
            self._plan.clear()  # the pulses have restarted
        self._plan.append(_PlannedGop(first, until, camera))
        if first < self._next - (until - first):
            self._next = first
        self.advance()

    def advance(self) -> None:
        """Show the pictures that have arrived, as far as they are planned."""
        while self._plan:
            gop = self._plan[0]
            camera = gop.camera or self._camera
            begin = max(self._next, gop.first)
            if camera is not None:
                for picture in self._buffers[camera].pictures(begin, gop.until - begin):
                    self.stream.push(picture)
                    self._next = picture.until
                if self._next < gop.until and not self._is_over(gop, self._buffers[camera]):
                    return
                if self._next < gop.until:
                    self.stream.fill(gop.until)
            self._next, self._camera = gop.until, camera
            self._plan.popleft()

    def _is_over(self, gop: _PlannedGop, buffer: FrameBuffer) -> bool:
        """Return whether no further picture of a GOP is to be expected."""
        newest = max(other.newest for other in self._buffers.values())
        return buffer.newest >= gop.until or newest >= gop.until - 1 + self._late_frames


class LivePersonStreams:
    """The live best views that somebody watches, each from its first viewer to its last."""

    def __init__(
        self, new_stream: Callable[[], PictureStream], buffers: Mapping[str, FrameBuffer], fps: float
    ) -> None:
        self._new_stream, self._buffers = new_stream, buffers
        self._late_frames = max(1, round(_LATE_S * fps))
        self._streams: dict[int, LivePersonStream] = {}
        self._recent: deque[ModeDecision] = deque(maxlen=_DECISIONS_KEPT)
        self._merged: Mapping[int, int] = {}

    def broadcaster(self, number: int) -> Broadcaster:
        """Return a person's stream; the caller subscribes to it at once."""
        stream = self._streams.get(number)
        if stream is None:
            stream = LivePersonStream(self._new_stream(), self._buffers, self._late_frames)
            self._streams[number] = stream
            newest = max(buffer.newest for buffer in self._buffers.values())
            begun = [decision.first for decision in self._recent if decision.first <= newest]
            for decision in self._recent:
                if not begun or decision.first >= begun[-1]:
                    self._plan(stream, number, decision)
        return stream.stream.broadcaster

    def decide(self, decision: ModeDecision, merged: Mapping[int, int]) -> None:
        """Continue all streams by the next decision; one without viewers ends."""
        if self._recent and decision.first < self._recent[-1].first:
            self._recent.clear()  # the pulses have restarted
        self._recent.append(decision)
        self._merged = merged
        for number, stream in list(self._streams.items()):
            stream.idle_decisions = 0 if stream.stream.broadcaster.viewers else stream.idle_decisions + 1
            if stream.idle_decisions >= _IDLE_DECISIONS:
                self._streams.pop(number).stream.broadcaster.close()
            else:
                self._plan(stream, number, decision)

    def arrived(self) -> None:
        """Show the pictures that have arrived."""
        for stream in self._streams.values():
            stream.advance()

    def forget(self, known: Collection[int]) -> None:
        """End the streams of persons that are not known any more."""
        for number in [number for number in self._streams if number not in known]:
            self._streams.pop(number).stream.broadcaster.close()

    def viewers_of(self, number: int) -> int:
        """Return the number of viewers of a person's stream."""
        stream = self._streams.get(number)
        return 0 if stream is None else stream.stream.broadcaster.viewers

    @property
    def viewers(self) -> int:
        """The number of viewers of all streams."""
        return sum(stream.stream.broadcaster.viewers for stream in self._streams.values())

    def close(self) -> None:
        """End all streams."""
        for stream in self._streams.values():
            stream.stream.broadcaster.close()

    def _plan(self, stream: LivePersonStream, number: int, decision: ModeDecision) -> None:
        cameras = decision.cameras
        camera = cameras.get(number) or cameras.get(self._merged.get(number, number))
        stream.plan(decision.first, decision.first + decision.frames, camera)
