"""Who was where: one camera's boxes by pulse, the newest word on each frame."""

from __future__ import annotations

from server.wire.messages import Box, CameraTracks


class BoxHistory:
    """Keeps for every frame of one camera the boxes of its tracks, by the tracks' local number."""

    def __init__(self) -> None:
        self._rows: dict[int, dict[int, Box]] = {}

    def put(self, message: CameraTracks, local_of: dict[int, int]) -> None:
        """Take over a window; ``local_of`` maps the tracker's numbers to local ones."""
        for place, pulse in enumerate(range(message.first, message.last + 1)):
            self._rows[pulse] = {
                local_of[track.id]: box for track in message.tracks if (box := track.boxes[place]) is not None
            }

    def at(self, pulse: int) -> dict[int, Box]:
        """Give the boxes of a frame by local number."""
        return self._rows.get(pulse, {})

    def forget_before(self, pulse: int) -> None:
        """Let go of the frames before a pulse."""
        for old in [known for known in self._rows if known < pulse]:
            del self._rows[old]
