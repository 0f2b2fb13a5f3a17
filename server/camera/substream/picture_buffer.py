"""The newest pictures of a substream, among which the one of a moment is found."""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from dataclasses import dataclass

from av.video.frame import VideoFrame

from server.camera.sources.stream_clock import CaptureTime

_MATCH_S = 0.25
"""A picture further away, in seconds, is not of the same moment: people have moved on."""
_STALE_S = 1.5
"""Seconds without a picture after which the next one is not waited for."""
_MAX_PICTURES = 600
_MAX_BYTES = 256_000_000
"""Of the pictures that are kept: eight seconds at 1280x720 and 25 a second."""
_MAX_REQUESTS = 200
"""Requests that wait for a picture; older ones are answered when they are asked for."""


@dataclass(frozen=True, slots=True, eq=False)
class BufferedPicture:
    """A picture of the substream.

    Attributes:
        picture: as decoded.
        pixel_aspect: width of its pixels over their height; 1: not declared.
        captured: when it was captured.
    """

    picture: VideoFrame
    pixel_aspect: float
    captured: CaptureTime

    @property
    def size_bytes(self) -> int:
        """The memory of the picture."""
        return sum(plane.buffer_size for plane in self.picture.planes)


class PictureRequest:
    """A picture that is looked for, and found when it arrives: it may be asked for much later."""

    def __init__(self, captured: CaptureTime) -> None:
        self.captured = captured
        self.picture: BufferedPicture | None = None
        """The picture of that time, up to 0.25 s apart; None: there is none, or it is not known yet."""
        self.is_answered = False


class PictureBuffer:
    """Keeps pictures of some seconds, as far as they fit into memory. One thread adds, others find.

    Args:
        keep_s: seconds by which the main stream may be later.
        tolerance_s: a picture so much earlier is of the same moment: the next one need not be waited for.
        max_bytes: of the pictures; the newest is kept in any case.
    """

    def __init__(self, keep_s: float, tolerance_s: float, max_bytes: int = _MAX_BYTES) -> None:
        self._keep_s, self._tolerance_s, self._max_bytes = keep_s, tolerance_s, max_bytes
        self.kept_s: float | None = None
        """Seconds of pictures that fitted; None: all that are to be kept do."""
        self.is_too_many = False
        """Whether it was their number that did not fit, not their memory."""
        self._pictures: deque[BufferedPicture] = deque()
        self._bytes = 0
        self._open: deque[PictureRequest] = deque(maxlen=_MAX_REQUESTS)
        self._newest_at: float | None = None
        self._changed = threading.Condition()

    def put(self, picture: BufferedPicture) -> None:
        """Add a picture that has arrived just now."""
        now = time.monotonic()
        with self._changed:
            self._pictures.append(picture)
            self._bytes += picture.size_bytes
            self._newest_at = now
            for request in [each for each in self._open if self._is_reached(each)]:
                self._answer(request)
                self._open.remove(request)
            self._drop(now)
            self._changed.notify_all()

    def _drop(self, now: float) -> None:
        """Drop the oldest pictures that are too old, or do not fit."""
        while len(self._pictures) > 1:
            age = now - self._pictures[0].captured.arrival
            is_too_large = self._bytes > self._max_bytes
            is_full = is_too_large or len(self._pictures) > _MAX_PICTURES
            if not is_full and age <= self._keep_s:
                return
            if is_full and age < self._keep_s:
                self.kept_s, self.is_too_many = age, not is_too_large
            self._bytes -= self._pictures.popleft().size_bytes

    def request(self, captured: CaptureTime) -> PictureRequest:
        """Look for the picture captured at a time."""
        request = PictureRequest(captured)
        with self._changed:
            if self._is_reached(request):
                self._answer(request)
            else:
                self._open.append(request)
        return request

    def wait(self, request: PictureRequest, until: float) -> BufferedPicture | None:
        """Return a request's picture; wait for it up to a time by the steady clock, while pictures arrive."""
        with self._changed:
            while not request.is_answered:
                now = time.monotonic()
                stale_at = 0.0 if self._newest_at is None else self._newest_at + _STALE_S
                if (wait_s := min(until, stale_at) - now) <= 0:
                    self._answer(request)
                    with contextlib.suppress(ValueError):  # it was one of too many
                        self._open.remove(request)
                    break
                self._changed.wait(wait_s)
            return request.picture

    def _is_reached(self, request: PictureRequest) -> bool:
        """Return whether no later picture can be closer."""
        if not self._pictures:
            return False
        return self._pictures[-1].captured.seconds_after(request.captured) >= -self._tolerance_s

    def _answer(self, request: PictureRequest) -> None:
        """Answer a request with the closest picture that has arrived, if that is close enough."""
        request.is_answered = True
        distances = [abs(each.captured.seconds_after(request.captured)) for each in self._pictures]
        if distances and (least := min(distances)) <= _MATCH_S:
            request.picture = self._pictures[distances.index(least)]
