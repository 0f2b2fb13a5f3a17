"""Series of JPEG: each picture at its moment, to whoever watches at a rate that it belongs to."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from server.media.rendering_messages import Canvas, JpegPicture, RenderResult, is_in_series
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.subscriber_queue import BytesChunk, Subscriber


class PicturePacer:
    """Paces pictures; ``most`` is the longest a picture is held back, in seconds."""

    def __init__(self, fps: float, most: float) -> None:
        self._fps, self._most = fps, most
        self._zero: float | None = None

    def due(self, pulse: int, now: float) -> float:
        """Return when to show a picture, in seconds of the clock of ``now``, at the rate of the pulses.

        A picture that comes too late is shown now, and what follows is later by as much. What would have to
        wait too long, since what lay between did not come, is shown now, and what follows is earlier.
        """
        after = pulse / self._fps
        if self._zero is None or not now <= self._zero + after <= now + self._most:
            self._zero = now - after
        return self._zero + after


CONTENT_TYPE = "multipart/x-mixed-replace; boundary=picture"
FIRST_BOUNDARY = b"--picture\r\n"
"""What the answer begins with."""
PULSE_HEADER = "X-MyView-Pulse"


def multipart_part(picture: JpegPicture) -> bytes:
    """Return one picture with the boundary that ends it: browsers show it only after that."""
    head = [
        "Content-Type: image/jpeg",
        f"Content-Length: {len(picture.data)}",
        f"{PULSE_HEADER}: {picture.pulse}",
    ]
    return "\r\n".join([*head, "", ""]).encode("ascii") + picture.data + b"\r\n" + FIRST_BOUNDARY


_NEWEST = 1
"""A viewer has one picture waiting at the most: the newest."""
_KEPT_GOPS = 2
"""So much is kept back at the most, to be shown in pace."""


@dataclass(frozen=True, slots=True)
class MjpegVariant:
    """Pictures at one rate."""

    rate: float
    """A second."""
    boxed: bool


@dataclass(frozen=True, slots=True)
class _ScheduledPicture:
    """A picture and its moment."""

    at: float
    picture: JpegPicture
    boxed: bool


class MjpegStreams:
    """All series of one stream. ``live`` pictures are shown as they come, others in pace."""

    def __init__(self, canvas: Canvas, *, live: bool) -> None:
        self._fps, self._live = canvas.fps, live
        self._pace = PicturePacer(canvas.fps, _KEPT_GOPS * canvas.gop / canvas.fps)
        self._waiting: deque[_ScheduledPicture] = deque(
            maxlen=4 * _KEPT_GOPS * canvas.gop
        )  # more than the pace keeps
        self._channels: dict[MjpegVariant, Broadcaster] = {}
        self._last = -1
        self._closed = False

    @property
    def viewers(self) -> int:
        """How many are watching."""
        return sum(channel.viewers for channel in self._channels.values())

    def join(self, series: MjpegVariant) -> Subscriber:
        """Let a viewer in; call :meth:`leave` in the end."""
        channel = self._channels.setdefault(series, Broadcaster(queue_gops=_NEWEST))
        if self._closed:
            channel.close()
        return channel.subscribe()

    def leave(self, series: MjpegVariant, viewer: Subscriber) -> None:
        """Let a viewer go."""
        self._channels[series].unsubscribe(viewer)
        if not self._channels[series].viewers:
            del self._channels[series]

    def rates(self, *, boxed: bool) -> list[float]:
        """Return the rates that have viewers."""
        return sorted({series.rate for series in self._channels if series.boxed is boxed})

    def put(self, drawn: RenderResult, now: float) -> None:
        """Take in what was drawn; ``now`` is in seconds by a clock that never steps."""
        pictures = [(it, False) for it in drawn.plain] + [(it, True) for it in drawn.boxed]
        for picture, boxed in sorted(pictures, key=lambda it: it[0].pulse):
            if picture.pulse > self._last:
                at = now if self._live else self._pace.due(picture.pulse, now)
                self._waiting.append(_ScheduledPicture(at, picture, boxed))
        self._last = max(self._last, drawn.newest)

    def show(self, now: float) -> float | None:
        """Pass on what is due; give the moment of the next picture, None where none waits."""
        while self._waiting and self._waiting[0].at <= now:
            due = self._waiting.popleft()
            chunk = BytesChunk(multipart_part(due.picture), random_access=True)
            for series, channel in self._channels.items():
                if series.boxed is due.boxed and is_in_series(due.picture.pulse, series.rate, self._fps):
                    channel.publish(chunk)
        return self._waiting[0].at if self._waiting else None

    def close(self) -> None:
        """End all of them for everybody."""
        self._closed = True
        for channel in self._channels.values():
            channel.close()
