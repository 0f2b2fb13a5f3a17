"""Repair of time stamps that jump within a recording, as in joined files."""

from __future__ import annotations

import av
from av.video.stream import VideoStream

from server.camera.sources.opening import OpenedVideo

_BACK_S = 1.0
_FAR_S, _FAR_FRAMES = 60.0, 10
"""A step forward beyond the larger of the two, in seconds and frames, is a jump."""


class TimestampJumpRepair:
    """Shifts time stamps so that they continue with the next frame after a jump."""

    def __init__(self, opened: OpenedVideo) -> None:
        unit = float(opened.stream.time_base or 1)
        self._frame = max(1, round(1 / (opened.fps * unit)))
        self._back = round(_BACK_S / unit) + self._frame
        self._far = max(round(_FAR_S / unit), _FAR_FRAMES * self._frame)
        self._last: int | None = None
        self._shift = 0

    def repair_jump(self, packet: av.Packet[VideoStream]) -> bool:
        """Correct a packet's time stamps; return whether they jump here. Packets are in decoding order."""
        time = packet.pts if packet.dts is None else packet.dts
        if time is None:
            return False
        time += self._shift
        jumps = self._last is not None and not self._last - self._back <= time <= self._last + self._far
        if jumps and self._last is not None:
            self._shift += self._last + self._frame - time
            time = self._last + self._frame
        self._last = time
        if self._shift:
            packet.pts = None if packet.pts is None else packet.pts + self._shift
            packet.dts = None if packet.dts is None else packet.dts + self._shift
        return jumps
