"""What can be known of the pictures of a network camera, which have no numbers.

At each pulse it shows the newest picture that has come. Which one that is depends on how long it was on its
way, so it is known beforehand within bounds only. But it is never an older one than before; it is of some
time around its pulse; and whoever is shown this pulse is shown this picture.
"""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.faults.video.stamped_views import FPS, FRAMES

_WAY_S = 0.5
"""So long a picture may be on its way; so late a pulse may be taken, when newer pictures have come."""
_STALE_S = 1.5
"""So old a picture may be besides: after that its camera counts as away (`live_stream`)."""
MOST_BEHIND = round((_WAY_S + _STALE_S) * FPS)
MOST_AHEAD = round(_WAY_S * FPS)


def behind(pulse: int, frame: int) -> int:
    """Return by how many frames a picture is older than its pulse: its number is known up to whole films."""
    return (pulse - frame + FRAMES // 2) % FRAMES - FRAMES // 2


class LiveFrameOrder:
    """Follows the pictures of one network camera, by rising pulses."""

    def __init__(self) -> None:
        self._newest: int | None = None
        self.frames: dict[int, int] = {}
        """The frame that was shown at a pulse."""
        self.behind: list[int] = []
        """By how much each was behind its pulse."""

    def wrong(self, pulse: int, frame: int) -> str:
        """Take the next picture; give what is wrong with it, if anything."""
        late = behind(pulse, frame)
        newest, self._newest = self._newest, pulse - late
        self.frames[pulse] = frame
        self.behind.append(late)
        if not -MOST_AHEAD <= late <= MOST_BEHIND:
            return f", {late} frames behind its pulse"
        return "" if newest is None or newest <= pulse - late else f", {newest - pulse + late} frames back"


def differ(shown: Mapping[int, int], kept: Mapping[int, int]) -> list[str]:
    """Return which pictures that were shown are others than those that were recorded: frames by pulse."""
    return [
        f"pulse {pulse}: frame {frame} was shown, {kept[pulse]} recorded"
        for pulse, frame in shown.items()
        if kept.get(pulse, frame) != frame
    ]
