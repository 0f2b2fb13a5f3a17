"""Whether somebody has been seen lately: what who may see one person alone is shown goes by that.

A person's best view goes on while no camera sees them, from where they were seen last: it is then a picture
of the room, with whoever else is in it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from enum import Enum, auto

from server.messaging.messages import NumberedBox
from server.service.view_selection.decider import GopDecision

Boxes = Mapping[str, Sequence[Sequence[NumberedBox]]]
"""Per camera and frame: everybody's boxes."""


class Presence(Enum):
    """What a GOP shows to who may see one person alone."""

    PRESENT = auto()
    """The best view: some camera has seen the person lately, or sees them in this GOP."""
    HELD = auto()
    """The picture that was shown last, without sound."""
    ABSENT = auto()
    """Grey, without sound."""


class PresenceLog:
    """Notes GOP by GOP when everybody was last seen, by any camera.

    Who was not seen for more than ``unseen`` frames is held for as many more, and absent then. Who has never
    been seen is absent.
    """

    def __init__(self, unseen: int) -> None:
        self._unseen = unseen
        self._first = 0
        self._last: dict[int, int] = {}
        """By person, the last frame in which they were seen."""
        self._merged: Mapping[int, int] = {}

    def take(self, decision: GopDecision) -> None:
        """Take in whom the cameras have seen in the next GOP."""
        if decision.first < self._first:
            self._last.clear()  # pulses have begun anew
        self._first, self._merged = decision.first, decision.merged
        seen = {number: decision.first + place for number, place in last_seen_offsets(decision.boxes).items()}
        before, self._last = self._last, {}
        for some in (before, seen):
            for number, pulse in some.items():
                person = decision.merged.get(number, number)
                self._last[person] = max(pulse, self._last.get(person, pulse))

    def of(self, number: int) -> Presence:
        """Return what the newest GOP shows of a person, by any of their numbers."""
        last = self._last.get(self._merged.get(number, number))
        if last is None or self._first - last > 2 * self._unseen:
            return Presence.ABSENT
        return Presence.PRESENT if self._first - last <= self._unseen else Presence.HELD

    def forget(self, known: Collection[int]) -> None:
        """Forget those whom nobody remembers any more."""
        self._last = {number: pulse for number, pulse in self._last.items() if number in known}


def last_seen_offsets(boxes: Boxes) -> dict[int, int]:
    """Return of everybody the last frame of a GOP in which a camera has seen them, from 0."""
    last: dict[int, int] = {}
    for frames in boxes.values():
        for place, frame in enumerate(frames):
            for number, *_ in frame:
                last[number] = max(place, last.get(number, place))
    return last
