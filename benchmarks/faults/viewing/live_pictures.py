"""Checks of the pictures of a network camera, whose frame at a pulse is known only within bounds.

A pulse shows the newest received picture, which depends on the transfer time. But it is never older than the
previous one, its time is close to the pulse, and all viewers get the same picture.
"""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.faults.video.stamped_views import FPS, FRAMES

_TRANSFER_S = 0.5
"""Maximum transfer time of a picture, and maximum delay of a pulse."""
_STALE_S = 1.5
"""Age from which a picture is stale, and its camera counts as lost (`live_stream`)."""
MAX_BEHIND = round((_TRANSFER_S + _STALE_S) * FPS)
MAX_AHEAD = round(_TRANSFER_S * FPS)


def behind(pulse: int, frame: int) -> int:
    """Return by how many frames a picture is behind its pulse, modulo the length of a film."""
    return (pulse - frame + FRAMES // 2) % FRAMES - FRAMES // 2


class LiveFrameOrder:
    """Checks the order of a network camera's pictures, pulse by pulse."""

    def __init__(self) -> None:
        self._newest: int | None = None
        self.frames: dict[int, int] = {}
        """The frame that was shown at a pulse."""
        self.behind: list[int] = []
        """Number of frames by which each picture was behind its pulse."""

    def check(self, pulse: int, frame: int) -> str:
        """Check the next picture; return what is wrong with it, or an empty text."""
        late = behind(pulse, frame)
        newest, self._newest = self._newest, pulse - late
        self.frames[pulse] = frame
        self.behind.append(late)
        if not -MAX_AHEAD <= late <= MAX_BEHIND:
            return f", {late} frames behind its pulse"
        return "" if newest is None or newest <= pulse - late else f", {newest - pulse + late} frames back"


def find_differences(shown: Mapping[int, int], recorded: Mapping[int, int]) -> list[str]:
    """Describe the pulses whose shown and recorded frames differ."""
    return [
        f"pulse {pulse}: frame {frame} was shown, {recorded[pulse]} recorded"
        for pulse, frame in shown.items()
        if recorded.get(pulse, frame) != frame
    ]
