"""Who stands still is seen once: a thousand frames of one person tell no more of people than one does.

A height line that counts frames is drawn to whoever stands longest, and to pieces of them, since what hides
somebody's feet hides them for as long as they stand there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.detectors.background.isolated_people import Alone

# Shares of a person's height by which middle, foot or head must have moved to count once more.
_STEP = 0.1
# Frames after which it is forgotten that somebody was seen in a place where nobody is.
_FORGET = 50


class SeenAnew:
    """Remembers where people were seen alone, and tells who is in a place in which nobody just was."""

    def __init__(self) -> None:
        self._places = np.empty((0, 3))
        self._since = np.empty(0)
        """Frames since somebody was there."""

    def of(self, people: Sequence[Alone], frames: int = 1) -> list[Alone]:
        """Give who of one frame's people counts; the look before was so many `frames` ago."""
        self._since += frames
        anew: list[Alone] = []
        for person in people:
            place = np.array([person.middle, person.foot, person.foot - person.height])
            same = np.abs(self._places - place).max(axis=1, initial=0.0) <= _STEP * person.height
            self._since[same] = 0.0
            if not same.any():
                anew.append(person)
                self._places = np.concatenate([self._places, place[None]])
                self._since = np.append(self._since, 0.0)
        kept = self._since <= _FORGET
        self._places, self._since = self._places[kept], self._since[kept]
        return anew
