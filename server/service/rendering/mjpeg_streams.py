"""MJPEG streams: publishes JPEG pictures in real time, to the viewers at each rate."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from server.media.rendering_messages import JpegPicture, RenderResult, RenderSettings, is_at_rate
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.subscriber_queue import BytesChunk, Subscriber


class PicturePacer:
    """Paces pictures; ``max_delay_s`` is the longest time a picture is held back."""

    def __init__(self, fps: float, max_delay_s: float) -> None:
        self._fps, self._max_delay_s = fps, max_delay_s
        self._zero: float | None = None
        """When pulse 0 was due."""

    def schedule(self, pulse: int, now: float) -> float:
        """Return when to show a picture, in seconds of the clock of ``now``, at the rate of the pulses.

        A picture that is late is shown now, and later ones are delayed as much. One that would have to wait
        too long, after a gap, is shown now, and later ones are that much earlier.
        """
        offset = pulse / self._fps
        if self._zero is None or not now <= self._zero + offset <= now + self._max_delay_s:
            self._zero = now - offset
        return self._zero + offset


CONTENT_TYPE = "multipart/x-mixed-replace; boundary=picture"
FIRST_BOUNDARY = b"--picture\r\n"
"""The first line of the response body."""
PULSE_HEADER = "X-MyView-Pulse"


def part_and_boundary(picture: JpegPicture) -> bytes:
    """Return one picture with the boundary that ends it: browsers display it only after the boundary."""
    head = [
        "Content-Type: image/jpeg",
        f"Content-Length: {len(picture.data)}",
        f"{PULSE_HEADER}: {picture.pulse}",
    ]
    return "\r\n".join([*head, "", ""]).encode("ascii") + picture.data + b"\r\n" + FIRST_BOUNDARY


_QUEUE_PICTURES = 1
"""At most one picture, the newest, waits for a viewer."""
_MAX_DELAY_GOPS = 2
"""How far pictures are held back at most to be shown in real time."""


@dataclass(frozen=True, slots=True)
class MjpegVariant:
    """A rate, with or without boxes."""

    rate: float
    """Pictures per second."""
    boxed: bool


@dataclass(frozen=True, slots=True)
class _ScheduledPicture:
    """A picture and the time to show it."""

    at: float
    picture: JpegPicture
    boxed: bool


class MjpegStreams:
    """All MJPEG variants of one stream. ``live`` pictures are shown as they arrive, others in real time."""

    def __init__(self, settings: RenderSettings, *, live: bool) -> None:
        self._fps, self._live = settings.fps, live
        self._pacer = PicturePacer(settings.fps, _MAX_DELAY_GOPS * settings.gop / settings.fps)
        self._scheduled: deque[_ScheduledPicture] = deque(
            maxlen=4 * _MAX_DELAY_GOPS * settings.gop
        )  # more than the pacer holds back
        self._broadcasters: dict[MjpegVariant, Broadcaster] = {}
        self._newest = -1
        self._closed = False

    @property
    def viewers(self) -> int:
        """The number of viewers."""
        return sum(broadcaster.viewers for broadcaster in self._broadcasters.values())

    def subscribe(self, variant: MjpegVariant) -> Subscriber:
        """Return a new subscriber; call :meth:`unsubscribe` in the end."""
        broadcaster = self._broadcasters.setdefault(variant, Broadcaster(queue_gops=_QUEUE_PICTURES))
        if self._closed:
            broadcaster.close()
        return broadcaster.subscribe()

    def unsubscribe(self, variant: MjpegVariant, subscriber: Subscriber) -> None:
        """Remove a subscriber."""
        self._broadcasters[variant].unsubscribe(subscriber)
        if not self._broadcasters[variant].viewers:
            del self._broadcasters[variant]

    def rates(self, *, boxed: bool) -> list[float]:
        """Return the rates that have viewers."""
        return sorted({variant.rate for variant in self._broadcasters if variant.boxed is boxed})

    def put(self, result: RenderResult, now: float) -> None:
        """Schedule the pictures of a result; ``now`` is in seconds of a monotonic clock."""
        pictures = [(picture, False) for picture in result.plain] + [
            (picture, True) for picture in result.boxed
        ]
        for picture, boxed in sorted(pictures, key=lambda pair: pair[0].pulse):
            if picture.pulse > self._newest:
                at = now if self._live else self._pacer.schedule(picture.pulse, now)
                self._scheduled.append(_ScheduledPicture(at, picture, boxed))
        self._newest = max(self._newest, result.newest)

    def publish_due(self, now: float) -> float | None:
        """Publish the pictures that are due; return when the next one is, None if there is none."""
        while self._scheduled and self._scheduled[0].at <= now:
            due = self._scheduled.popleft()
            chunk = BytesChunk(part_and_boundary(due.picture), random_access=True)
            for variant, broadcaster in self._broadcasters.items():
                if variant.boxed is due.boxed and is_at_rate(due.picture.pulse, variant.rate, self._fps):
                    broadcaster.publish(chunk)
        return self._scheduled[0].at if self._scheduled else None

    def close(self) -> None:
        """End the streams for all viewers."""
        self._closed = True
        for broadcaster in self._broadcasters.values():
            broadcaster.close()
