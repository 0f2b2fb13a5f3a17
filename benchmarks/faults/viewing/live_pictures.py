"""Checks of the pictures of a network camera, whose frame at a pulse is known within bounds only.

At each pulse the newest received picture is taken, which depends on its transfer time. But it is never older
than the previous one, it is of some time around its pulse, and all viewers get the same picture at a pulse.
"""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.faults.video.stamped_views import FPS, FRAMES

_WAY_S = 0.5
"""Seconds that a picture may take to arrive, and that a pulse may be handled late."""
_STALE_S = 1.5
"""Age from which a picture is stale, and its camera counts as lost (`live_stream`)."""
MOST_BEHIND = round((_WAY_S + _STALE_S) * FPS)
MOST_AHEAD = round(_WAY_S * FPS)


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
        """By how many frames each was behind its pulse."""

    def wrong(self, pulse: int, frame: int) -> str:
        """Check the next picture; return what is wrong with it, or an empty text."""
        late = behind(pulse, frame)
        newest, self._newest = self._newest, pulse - late
        self.frames[pulse] = frame
        self.behind.append(late)
        if not -MOST_AHEAD <= late <= MOST_BEHIND:
            return f", {late} frames behind its pulse"
        return "" if newest is None or newest <= pulse - late else f", {newest - pulse + late} frames back"


def differ(shown: Mapping[int, int], recorded: Mapping[int, int]) -> list[str]:
    """Describe the pulses whose shown and recorded frames differ."""
    return [
        f"pulse {pulse}: frame {frame} was shown, {recorded[pulse]} recorded"
        for pulse, frame in shown.items()
        if recorded.get(pulse, frame) != frame
    ]
