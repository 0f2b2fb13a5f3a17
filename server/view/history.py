"""What was said last of every frame of one camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Generic, TypeVar

Window = TypeVar("Window")


@dataclass(frozen=True, slots=True)
class Stretch(Generic[Window]):
    """Frames that one window spoke of last: the pulses from `first` to `last`."""

    window: Window
    first: int
    last: int


class History(Generic[Window]):
    """Keeps for every frame of one camera the window that spoke of it last."""

    def __init__(self) -> None:
        self._stretches: list[Stretch[Window]] = []
        """In order; no frame is in two of them."""

    def put(self, window: Window, first: int, last: int) -> None:
        """Take over what a window says of the frames from `first` to `last`."""
        if last < first:
            return
        before = [replace(it, last=min(it.last, first - 1)) for it in self._stretches if it.first < first]
        after = [replace(it, first=max(it.first, last + 1)) for it in self._stretches if it.last > last]
        self._stretches = [*before, Stretch(window, first, last), *after]

    def over(self, first: int, last: int) -> list[Stretch[Window]]:
        """Give what is known of the frames from `first` to `last`, in order; frames may be missing."""
        return [
            Stretch(it.window, max(it.first, first), min(it.last, last))
            for it in self._stretches
            if it.first <= last and it.last >= first
        ]

    def forget_before(self, pulse: int) -> None:
        """Let go of the frames before a pulse."""
        self._stretches = [
            replace(it, first=max(it.first, pulse)) for it in self._stretches if it.last >= pulse
        ]
