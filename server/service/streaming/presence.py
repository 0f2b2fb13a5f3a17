"""Whether a person was seen recently: determines what viewers with access to that person alone are shown.

While no camera sees a person, their best view stays with the last camera: it then shows the room, and
other people in it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from enum import Enum, auto

from server.messaging.messages import NumberedBox
from server.service.view_selection.decider import GopDecision

Boxes = Mapping[str, Sequence[Sequence[NumberedBox]]]
"""By camera and frame: the boxes of all persons."""


class ScopedPicture(Enum):
    """What a GOP shows to viewers with access to one person alone."""

    SHOWN = auto()
    """The best view: some camera has seen the person recently, or sees them in this GOP."""
    FROZEN = auto()
    """The picture that was shown last, muted."""
    GRAY = auto()
    """Gray, muted."""


class PresenceLog:
    """The last frame in which any camera saw each person, updated GOP by GOP.

    The picture of a person who was not seen for more than ``freeze_after`` frames is frozen for as many more,
    then gray. That of a person who has never been seen is gray.
    """

    def __init__(self, freeze_after: int) -> None:
        self._freeze_after = freeze_after
        self._first = 0
        self._last_seen: dict[int, int] = {}
        """By person, the last frame in which they were seen."""
        self._merged: Mapping[int, int] = {}

    def update(self, decision: GopDecision) -> None:
        """Update with the boxes of the next GOP."""
        if decision.first < self._first:
            self._last_seen.clear()  # the pulses have restarted
        self._first, self._merged = decision.first, decision.merged
        seen = {
            number: decision.first + offset for number, offset in last_seen_offsets(decision.boxes).items()
        }
        before, self._last_seen = self._last_seen, {}
        for pulses in (before, seen):
            for number, pulse in pulses.items():
                person = decision.merged.get(number, number)
                self._last_seen[person] = max(pulse, self._last_seen.get(person, pulse))

    def picture_of(self, number: int) -> ScopedPicture:
        """Return what the newest GOP shows of a person, given any of their numbers."""
        last = self._last_seen.get(self._merged.get(number, number))
        if last is None or self._first - last > 2 * self._freeze_after:
            return ScopedPicture.GRAY
        return ScopedPicture.SHOWN if self._first - last <= self._freeze_after else ScopedPicture.FROZEN

    def forget(self, known: Collection[int]) -> None:
        """Forget persons that are not known any more."""
        self._last_seen = {number: pulse for number, pulse in self._last_seen.items() if number in known}


def last_seen_offsets(boxes: Boxes) -> dict[int, int]:
    """Return, by person, the last frame of a GOP in which a camera saw them, counted from 0."""
    last: dict[int, int] = {}
    for frames in boxes.values():
        for offset, frame in enumerate(frames):
            for number, *_ in frame:
                last[number] = max(offset, last.get(number, offset))
    return last
