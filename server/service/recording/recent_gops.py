"""The last decided GOPs, by person or camera, while their frames are in the frame buffers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

from server.messaging.messages import GopChoices
from server.service.recording.media_files import RecordedGop
from server.service.streaming.frame_buffer import FrameBuffer


class RecentGops:
    """Finds GOPs of cameras and of persons in the frame buffers. ``gop`` is the number of frames of a GOP."""

    def __init__(self, frame_buffers: Mapping[str, FrameBuffer], gop: int, frames: int) -> None:
        self._frame_buffers, self._gop, self._frames = frame_buffers, gop, frames
        self._choices: deque[GopChoices] = deque()

    def put(self, choices: GopChoices) -> None:
        """Keep a decision as long as its frames."""
        if self._choices and choices.first < self._choices[-1].first:
            self._choices.clear()  # the pulses have restarted
        self._choices.append(choices)
        while self._choices[0].first < choices.first - self._frames:
            self._choices.popleft()

    def replace(self, change: Callable[[GopChoices], GopChoices]) -> None:
        """Replace every decision by a changed one about the same frames."""
        self._choices = deque(map(change, self._choices))

    @property
    def end(self) -> int:
        """The pulse after the newest decided frame; 0 before the first."""
        return self._choices[-1].first + self._choices[-1].frames if self._choices else 0

    def end_of_camera(self, camera: str) -> int:
        """Return the pulse after a camera's newest frame."""
        return self._frame_buffers[camera].newest + 1

    def choices(self, pulse: int) -> list[GopChoices]:
        """Return the decisions about a pulse and later ones."""
        return [choices for choices in self._choices if choices.first + choices.frames > pulse]

    def of_person(self, number: int, pulse: int) -> RecordedGop | None:
        """Return a person's GOP that holds a pulse, or the next one; None if nothing follows."""
        later = (choices for choices in self._choices if choices.first + choices.frames > pulse)
        gops = (self._complete(number, choices) for choices in later)
        return next((gop for gop in gops if gop is not None), None)

    def of_person_before(self, number: int, pulse: int) -> RecordedGop | None:
        """Return a person's last GOP that ends before a pulse; None if there is none."""
        earlier = (choices for choices in reversed(self._choices) if choices.first + choices.frames <= pulse)
        gops = (self._complete(number, choices) for choices in earlier)
        return next((gop for gop in gops if gop is not None), None)

    def _complete(self, number: int, choices: GopChoices) -> RecordedGop | None:
        camera = choices.choices.get(number)
        gop = None if camera is None else self.arrived_until_gap(camera, choices.first, choices.frames)
        return gop if gop is not None and len(gop.fragments) == choices.frames else None

    def of_camera(self, camera: str, pulse: int) -> RecordedGop | None:
        """Return a camera's GOP that holds a pulse, or the next one, up to its first missing frame."""
        frame_buffer = self._frame_buffers[camera]
        earliest = max(pulse, frame_buffer.newest - self._frames)
        for first in range(earliest // self._gop * self._gop, frame_buffer.newest + 1, self._gop):
            gop = self.arrived_until_gap(camera, first, self._gop)
            if gop is not None and gop.end > pulse:
                return gop
        return None

    def of_camera_until(self, camera: str, pulse: int) -> RecordedGop | None:
        """Return a camera's last GOP that begins before a pulse, cut there; None if there is none."""
        newest = self._frame_buffers[camera].newest
        begin = (min(pulse, newest + 1) - 1) // self._gop * self._gop
        for first in range(begin, max(-1, newest - self._frames), -self._gop):
            gop = self.arrived_until_gap(camera, first, self._gop)
            if gop is not None:
                return RecordedGop(gop.first, gop.fragments[: pulse - gop.first])
        return None

    def arrived_until_gap(self, camera: str, first: int, frames: int) -> RecordedGop | None:
        """Return a camera's frames of a GOP up to the first missing one; None if there are none."""
        fragments: list[bytes] = []
        for pulse in range(first, first + frames):
            frame = self._frame_buffers[camera].get(pulse)
            if frame is None or (not fragments and not frame.key):
                break
            fragments.append(frame.fragment)
        return RecordedGop(first, tuple(fragments)) if fragments else None
