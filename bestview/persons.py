"""The people who have a number."""

from __future__ import annotations

from dataclasses import dataclass, field

from bestview.looks import Looks


@dataclass(slots=True, eq=False)
class Person:
    """Somebody with a number.

    Attributes:
        number: from 1, never used for anybody else.
        last: frame of the last sighting.
        gone: said to be gone, and not back yet.
        looks: of the settled episodes.
        settled: their frames that were told to be this person's.
        nobody_since: frame since which the number has been no group's, though it was told; -1: it is.
    """

    number: int
    last: int = -1
    gone: bool = False
    looks: Looks = field(default_factory=Looks)
    settled: int = 0
    nobody_since: int = -1

    def absorb(self, other: Person) -> None:
        """Take over what is known of `other`: the two are one."""
        self.looks.add_all(other.looks)
        self.last = max(self.last, other.last)
        self.settled += other.settled
