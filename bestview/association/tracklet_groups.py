"""Groups of episodes that are one person, with what the person was before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bestview.association.appearance.mean_histograms import Looks
from bestview.association.registry.person import Person
from bestview.association.tracklet import Episode


@dataclass(eq=False)
class Group:
    """One person, as far as can be told now; complete before it is asked anything.

    Attributes:
        rows: of the tables.
        episodes: open ones.
        past: people whom the group was before.
        number: the person's; 0: nobody's yet.
    """

    rows: list[int] = field(default_factory=list)
    episodes: list[Episode] = field(default_factory=list)
    past: list[Person] = field(default_factory=list)
    number: int = 0

    @property
    def frames(self) -> int:
        """Sightings in all cameras."""
        return sum(episode.frames for episode in self.episodes)

    @property
    def first(self) -> int:
        """Frame of the first sighting that is not settled; only if there is any."""
        return min(episode.begin.frame for episode in self.episodes)

    @property
    def last(self) -> int:
        """Frame of the last one."""
        return max([*(it.end.frame for it in self.episodes), *(it.last for it in self.past)])

    @cached_property
    def cameras(self) -> set[str]:
        """Those that see the person, or have."""
        seen = {episode.key.camera for episode in self.episodes}
        return seen.union(
            *(it.looks.by_camera for it in self.episodes), *(it.looks.by_camera for it in self.past)
        )

    @cached_property
    def looks(self) -> Looks:
        """Of all that is in the group."""
        looks = Looks()
        for mine in [it.looks for it in self.past] + [it.looks for it in self.episodes]:
            looks.add_all(mine)
        return looks

    @property
    def told(self) -> dict[int, int]:
        """Frames by the number that they were told to be; what is about to be told counts as one."""
        told = {person.number: person.settled for person in self.past}
        for episode in self.episodes:
            if episode.number:
                told[episode.number] = told.get(episode.number, 0) + 1
            for number, frames in episode.told.items():
                told[number] = told.get(number, 0) + frames
        return told


def groups_of(episodes: Sequence[Episode], past: Sequence[Person], group: NDArray[np.int64]) -> list[Group]:
    """Collect the rows of each group: (N,) group of each row, episodes first; in the order of the rows."""
    found: dict[int, Group] = {}
    for row, name in enumerate(group.tolist()):
        mine = found.setdefault(name, Group())
        mine.rows.append(row)
        if row < len(episodes):
            mine.episodes.append(episodes[row])
        else:
            mine.past.append(past[row - len(episodes)])
    return list(found.values())
