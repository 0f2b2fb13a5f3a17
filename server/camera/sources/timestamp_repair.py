"""Times of packets that go on where a recording's own ones leap: joined films, clocks that were set."""

from __future__ import annotations

import av
from av.video.stream import VideoStream

from server.camera.sources.opening import OpenedVideo

_BACK_S = 1.0
_FAR_S, _FAR_FRAMES = 60.0, 10
"""A picture is not shown for longer than this, in seconds or in frames, whichever is more: that is a leap."""


class TimestampRepair:
    """Moves time stamps so that they go on with the next frame after a jump."""

    def __init__(self, opened: OpenedVideo) -> None:
        unit = float(opened.stream.time_base or 1)
        self._frame = max(1, round(1 / (opened.fps * unit)))
        self._back = round(_BACK_S / unit) + self._frame
        self._far = max(round(_FAR_S / unit), _FAR_FRAMES * self._frame)
        self._last: int | None = None
        self._shift = 0

    def leaps(self, packet: av.Packet[VideoStream]) -> bool:
        """Set a packet's times right; tell whether they leap here. Packets come in the order of decoding."""
        time = packet.pts if packet.dts is None else packet.dts
        if time is None:
            return False
        time += self._shift
        leap = self._last is not None and not self._last - self._back <= time <= self._last + self._far
        if leap and self._last is not None:
            self._shift += self._last + self._frame - time
            time = self._last + self._frame
        self._last = time
        if self._shift:
            packet.pts = None if packet.pts is None else packet.pts + self._shift
            packet.dts = None if packet.dts is None else packet.dts + self._shift
        return leap
