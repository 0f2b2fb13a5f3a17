"""The last decisions, in memory: what was shown of whom as long as the frames are on the shelves."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from server.messaging.messages import GopChoices
from server.service.recording.media_files import RecordedGop
from server.service.streaming.frame_buffer import FrameBuffer


class RecentGops:
    """Finds GOPs on the shelves, of cameras and of people. ``gop`` is the length of a GOP in frames."""

    def __init__(self, frame_buffers: Mapping[str, FrameBuffer], gop: int, frames: int) -> None:
        self._shelves, self._gop, self._frames = frame_buffers, gop, frames
        self._choices: deque[GopChoices] = deque()

    def put(self, choices: GopChoices) -> None:
        """Remember a decision for as long as its frames are."""
        if self._choices and choices.first < self._choices[-1].first:
            self._choices.clear()  # pulses have begun anew
        self._choices.append(choices)
        while self._choices[0].first < choices.first - self._frames:
            self._choices.popleft()

    @property
    def end(self) -> int:
        """The pulse after the newest decided frame; 0 before the first."""
        return self._choices[-1].first + self._choices[-1].frames if self._choices else 0

    def end_of_camera(self, camera: str) -> int:
        """Give the pulse after a camera's newest frame."""
        return self._shelves[camera].newest + 1

    def choices(self, pulse: int) -> list[GopChoices]:
        """Give the decisions about a pulse and those after it."""
        return [it for it in self._choices if it.first + it.frames > pulse]

    def of_object(self, number: int, pulse: int) -> RecordedGop | None:
        """Give somebody's GOP that holds a pulse, or the next one; None where nothing follows."""
        followed = (it for it in self._choices if it.first + it.frames > pulse)
        return next((gop for it in followed if (gop := self._whole(number, it)) is not None), None)

    def of_object_before(self, number: int, pulse: int) -> RecordedGop | None:
        """Give somebody's last GOP that ends before a pulse; None where there is none."""
        before = (it for it in reversed(self._choices) if it.first + it.frames <= pulse)
        return next((gop for it in before if (gop := self._whole(number, it)) is not None), None)

    def _whole(self, number: int, choices: GopChoices) -> RecordedGop | None:
        camera = choices.choices.get(number)
        gop = None if camera is None else self.delivered(camera, choices.first, choices.frames)
        return gop if gop is not None and len(gop.fragments) == choices.frames else None

    def of_camera(self, camera: str, pulse: int) -> RecordedGop | None:
        """Give a camera's GOP that holds a pulse, or the next one, as far as it has come."""
        frame_buffer = self._shelves[camera]
        earliest = max(pulse, frame_buffer.newest - self._frames)
        for first in range(earliest // self._gop * self._gop, frame_buffer.newest + 1, self._gop):
            gop = self.delivered(camera, first, self._gop)
            if gop is not None and gop.end > pulse:
                return gop
        return None

    def of_camera_before(self, camera: str, pulse: int) -> RecordedGop | None:
        """Give a camera's last GOP that begins before a pulse, up to there; None where there is none."""
        newest = self._shelves[camera].newest
        begin = (min(pulse, newest + 1) - 1) // self._gop * self._gop
        for first in range(begin, max(-1, newest - self._frames), -self._gop):
            gop = self.delivered(camera, first, self._gop)
            if gop is not None:
                return RecordedGop(gop.first, gop.fragments[: pulse - gop.first])
        return None

    def delivered(self, camera: str, first: int, frames: int) -> RecordedGop | None:
        """Give what a camera delivered of a GOP up to the first missing frame; None: not even that."""
        found: list[bytes] = []
        for pulse in range(first, first + frames):
            frame = self._shelves[camera].get(pulse)
            if frame is None or (not found and not frame.key):
                break
            found.append(frame.fragment)
        return RecordedGop(first, tuple(found)) if found else None
