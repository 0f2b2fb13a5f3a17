"""What was said of people by hand, tied to the tracks that follow them.

A number means nothing to the next run of the service, and nobody's looks are sure enough for a name. But the
cameras' processes outlast the service, and go on following: whoever one of their tracks follows before and
after is the same person, as far as a track is ever somebody.
"""

from __future__ import annotations

import msgspec

from server.view.locals import Followed
from server.view.people import People

LONGEST_S = 10.0
"""Seconds that the service may be away: in a longer time a track may have gone over to somebody else."""


class Told(msgspec.Struct, frozen=True):
    """One person, of whom something was said."""

    name: str
    """Empty: none."""
    merged: bool
    """Several numbers were said to be theirs."""
    tracks: list[Followed]
    """Those that follow them."""


class SaidByHand(msgspec.Struct, frozen=True):
    """All of them, as of a pulse."""

    site: str
    pulse: int
    people: list[Told]


def said_by_hand(people: People, site: str, pulse: int) -> SaidByHand:
    """Put down what was said of whoever is followed now."""
    merged = set(people.merged_by_hand.values())
    if not people.names and not merged:
        return SaidByHand(site, pulse, [])
    told = [
        Told(people.names.get(number, ""), number in merged, tracks)
        for number, tracks in people.followed({*people.names, *merged}).items()
    ]
    return SaidByHand(site, pulse, told)


class Returning:
    """Gives people back what an earlier run of the service was told of them, as they are found again."""

    def __init__(self, said: SaidByHand, site: str, longest: int) -> None:
        self._said, self._longest = said, longest
        self._awaited: list[Told] = list(said.people) if said.site == site else []
        self._found: dict[Followed, int] = {}
        """The pulse at which each track was first heard of again."""

    @property
    def over(self) -> bool:
        """Whether nobody is awaited any more."""
        return not self._awaited

    def look(self, people: People, pulse: int) -> None:
        """Look for them after an epoch that ends with a pulse was taken in."""
        if not self._said.pulse < pulse <= self._said.pulse + self._longest:
            self._awaited = []  # pulses began anew, or too many have gone by
        self._awaited = [told for told in self._awaited if not self._give_back(told, people, pulse)]

    def _give_back(self, told: Told, people: People, pulse: int) -> bool:
        """Tell whether somebody is here again, with all that is to be said of them said."""
        found = [self._number(it, people, pulse) for it in told.tracks]
        numbers = sorted({it for it in found if it is not None})
        if not numbers:
            return False
        kept, *others = numbers
        if told.name and kept not in people.names:
            people.call(kept, told.name)
        for other in others if told.merged else ():
            people.merge(kept, other)
        return not told.merged or None not in found

    def _number(self, track: Followed, people: People, pulse: int) -> int | None:
        """Give whose a track was when it was first heard of again; None: nobody knows."""
        if people.heard_of(track):
            self._found.setdefault(track, pulse)
        first = self._found.get(track)
        return None if first is None else people.whose(track.camera, track.boot, track.track, first)
