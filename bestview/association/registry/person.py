"""The people who have a number."""

from __future__ import annotations

from dataclasses import dataclass, field

from bestview.association.affinity.travel_times import Sight
from bestview.association.appearance.mean_histograms import Looks


@dataclass(slots=True, eq=False)
class Person:
    """Somebody with a number.

    Attributes:
        number: from 1, never used for anybody else.
        last: frame of the last sighting.
        camera: in which that was; of several the first by name.
        gone: said to be gone, and not back yet.
        looks: of the settled episodes.
        settled: their frames that were told to be this person's.
        nobody_since: frame since which the number has been no group's, though it was told; -1: it is.
    """

    number: int
    last: int = -1
    camera: str = ""
    gone: bool = False
    looks: Looks = field(default_factory=Looks)
    settled: int = 0
    nobody_since: int = -1

    @property
    def sight(self) -> Sight:
        """Where they were seen last."""
        return Sight(self.camera, self.last)

    def see(self, camera: str, frame: int) -> None:
        """Note a sighting."""
        if frame > self.last or (frame == self.last and camera < self.camera):
            self.last, self.camera = frame, camera

    def absorb(self, other: Person) -> None:
        """Take over what is known of `other`: the two are one."""
        self.looks.add_all(other.looks)
        self.see(other.camera, other.last)
        self.settled += other.settled
