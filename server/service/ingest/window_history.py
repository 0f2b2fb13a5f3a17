"""The newest window that covers each frame of one camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

Window = TypeVar("Window")


@dataclass(frozen=True, slots=True)
class HistorySpan(Generic[Window]):
    """Frames from pulse `first` to `last` whose newest window is the same."""

    window: Window
    first: int
    last: int


class WindowHistory(Generic[Window]):
    """Stores for every frame of one camera the newest window that covers it."""

    def __init__(self) -> None:
        self._spans: list[HistorySpan[Window]] = []
        """In order, without overlap."""

    def put(self, window: Window, first: int, last: int) -> None:
        """Replace the frames from `first` to `last` by those of a window."""
        if last < first:
            return
        before, after = self.over(self._earliest, first - 1), self.over(last + 1, self._latest)
        self._spans = [*before, HistorySpan(window, first, last), *after]

    def over(self, first: int, last: int) -> list[HistorySpan[Window]]:
        """Return the spans in the frames from `first` to `last`, in order; frames may be missing."""
        return [
            HistorySpan(span.window, max(span.first, first), min(span.last, last))
            for span in self._spans
            if span.first <= last and span.last >= first
        ]

    def forget_before(self, pulse: int) -> None:
        """Drop the frames before a pulse."""
        self._spans = self.over(pulse, self._latest)

    @property
    def _earliest(self) -> int:
        return self._spans[0].first if self._spans else 0

    @property
    def _latest(self) -> int:
        return self._spans[-1].last if self._spans else -1
