"""Who was where: one camera's boxes by pulse, the newest word on each frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from server.wire.messages import Box, CameraTracks


@dataclass(frozen=True, slots=True)
class _Word:
    """The boxes of a window, frame by frame from `first` on, by the tracks' local numbers."""

    first: int
    boxes: Mapping[int, Sequence[Box | None]]


class BoxHistory:
    """Keeps for every frame of one camera the window that spoke of it last.

    Boxes are looked up when they are asked for: most windows are replaced before anybody does.
    """

    def __init__(self) -> None:
        self._words: dict[int, _Word] = {}

    def put(self, message: CameraTracks, local_of: Mapping[int, int]) -> None:
        """Take over a window; ``local_of`` maps the tracker's numbers to local ones."""
        word = _Word(message.first, {local_of[track.id]: track.boxes for track in message.tracks})
        self._words.update(dict.fromkeys(range(message.first, message.last + 1), word))

    def at(self, pulse: int) -> dict[int, Box]:
        """Give the boxes of a frame by local number."""
        word = self._words.get(pulse)
        if word is None:
            return {}
        place = pulse - word.first
        return {local: box for local, boxes in word.boxes.items() if (box := boxes[place]) is not None}

    def forget_before(self, pulse: int) -> None:
        """Let go of the frames before a pulse."""
        for old in [known for known in self._words if known < pulse]:
            del self._words[old]
