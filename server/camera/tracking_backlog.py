"""The frames of a camera that wait for detection and tracking, which may be slower than the video."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from server.camera.captured_frame import CapturedFrame

_FRAMES_PER_IMAGE = 10
"""Frames that may wait per image that may wait; further ones count as missed."""


@dataclass(frozen=True, slots=True, eq=False)
class QueuedFrame:
    """A frame that waits for tracking.

    Attributes:
        pulse: its pulse.
        frame: None: there was none, or it was shed.
        captured: when it was captured, by the loop's clock.
        due: when its pulse was due, likewise.
        skipped: whether load shedding left it out.
    """

    pulse: int
    frame: CapturedFrame | None
    captured: float
    due: float
    skipped: bool = False


class TrackingBacklog:
    """A queue of frames; those far ahead of tracking lose their picture, and the furthest are left out.

    Args:
        images_max: images that may wait.
        oldest_s: seconds after its pulse from which a frame is not searched: its tracks would come too late.
    """

    def __init__(self, images_max: int, oldest_s: float) -> None:
        self._images_max, self._oldest_s = images_max, oldest_s
        self.frames_max = _FRAMES_PER_IMAGE * images_max
        """Frames that may wait."""
        self._frames: asyncio.Queue[QueuedFrame | None] = asyncio.Queue(maxsize=self.frames_max)

    def __len__(self) -> int:
        return self._frames.qsize()

    def put(self, pulse: int, frame: CapturedFrame | None, due: float, *, skipped: bool = False) -> bool:
        """Add a frame captured now, due at ``due`` by the loop's clock; return whether it was shed."""
        shed = frame is not None and self._frames.qsize() >= self._images_max
        if not self._frames.full():
            now = asyncio.get_running_loop().time()
            self._frames.put_nowait(QueuedFrame(pulse, None if shed else frame, now, due, skipped or shed))
        return shed

    def is_outdated(self, frame: QueuedFrame) -> bool:
        """Return whether a frame that was got has waited for too long; not if none waits behind it.

        The service waits as long for cameras that are behind. Searches may take longer than frames last, so
        that a few frames that wait can be too many.
        """
        late = asyncio.get_running_loop().time() - frame.due
        return late > self._oldest_s and not self._frames.empty()

    async def end(self) -> None:
        """Add the end of the recording, once there is room."""
        await self._frames.put(None)

    async def get(self) -> QueuedFrame | None:
        """Wait for the next frame, and remove it; None: the recording has ended."""
        return await self._frames.get()
