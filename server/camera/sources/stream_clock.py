"""When the pictures of a stream were captured: by the camera's own clock, and by their arrival."""

from __future__ import annotations

import struct
from collections import deque
from dataclasses import dataclass

import av
from av.video.stream import VideoStream

_SPAN_S = 5.0
"""Seconds over which the least delay is taken."""
_SAME_CLOCK_S = 1.0
"""Streams whose delays, by their cameras' clocks, differ by more do not have the same clock."""
_WALL_CLOCK = struct.Struct("<q")
"""The beginning of FFmpeg's AVProducerReferenceTime: unix microseconds."""


@dataclass(frozen=True, slots=True)
class CaptureTime:
    """When a picture was captured.

    Attributes:
        arrival: when it would have arrived with the least delay of late, seconds by the steady clock.
        camera: seconds by the camera's clock, which another stream of the camera has, too; None: unknown.
    """

    arrival: float
    camera: float | None = None

    def seconds_after(self, other: CaptureTime) -> float:
        """Return how much later than a picture of another stream of the camera it was captured, seconds.

        By the camera's clock where both have it, else by arrival: then it contains the difference of delays.
        """
        if self.camera is not None and other.camera is not None:
            delays = (self.arrival - self.camera) - (other.arrival - other.camera)
            if abs(delays) <= _SAME_CLOCK_S:
                return self.camera - other.camera
        return self.arrival - other.arrival


class StreamClock:
    """Maps the time stamps of one connection to capture times.

    The camera's clock is known from RTCP sender reports (RFC 3550, 6.4.1), which most send every few seconds.
    """

    def __init__(self) -> None:
        self._delays: deque[tuple[float, float]] = deque()
        """Arrivals and delays (arrival less time stamp), of which no later one is smaller."""
        self._camera_offset: float | None = None

    def observe(self, packet: av.Packet[VideoStream], now: float) -> None:
        """Learn from a packet that has arrived just now, by the steady clock."""
        if packet.pts is None or packet.time_base is None:
            return
        time = float(packet.pts * packet.time_base)
        while self._delays and self._delays[-1][1] >= now - time:
            self._delays.pop()
        self._delays.append((now, now - time))
        while self._delays[0][0] < now - _SPAN_S:
            self._delays.popleft()
        reference = _reference_time(packet)
        if reference is not None:
            self._camera_offset = reference - time

    def at(self, time: float | None, now: float) -> CaptureTime:
        """Return when a picture with this time stamp, seconds, was captured; without one: just now."""
        if time is None or not self._delays:
            return CaptureTime(now)
        camera = None if self._camera_offset is None else time + self._camera_offset
        return CaptureTime(time + self._delays[0][1], camera)


def _reference_time(packet: av.Packet[VideoStream]) -> float | None:
    """Return the capture time by the last sender report, unix seconds; None: none has arrived yet."""
    if not hasattr(packet, "has_sidedata") or not packet.has_sidedata("prft"):  # PyAV before 16 has none
        return None
    data = bytes(packet.get_sidedata("prft"))
    return _WALL_CLOCK.unpack_from(data)[0] / 1e6 if len(data) >= _WALL_CLOCK.size else None
