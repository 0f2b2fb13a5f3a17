"""Who has no number yet: somebody found again, or somebody new."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from bestview.association.affinity.affinity_matrix import PairTables
from bestview.association.affinity.travel_times import Sight, TravelTimes
from bestview.association.appearance.cross_camera import LooksBetween
from bestview.association.appearance.mean_histograms import Looks
from bestview.association.registry.person import Person
from bestview.association.registry.reidentification import find_again
from bestview.association.settings import IdentitySettings
from bestview.association.tracklet_groups import Group


@dataclass(frozen=True, slots=True, eq=False)
class Lost:
    """Somebody whom no camera sees.

    Attributes:
        person: who.
        group: what of them is grouped with everybody else; None: nothing is.
    """

    person: Person
    group: Group | None

    @property
    def looks(self) -> Looks:
        """How they look, with what is not settled yet."""
        return self.person.looks if self.group is None else self.group.looks


class Newcomers:
    """Tells newcomers from those who come again, by their looks and by the time that the way takes.

    Args:
        settings: of identity.
        cameras: how many there are.
    """

    def __init__(self, settings: IdentitySettings, cameras: int) -> None:
        self._settings = settings
        self._travel = TravelTimes(settings, cameras)
        self._meeting: set[tuple[str, str]] = set()
        """Cameras that have seen one person at once."""

    def see_at_once(self, groups: Iterable[Group], frame: int) -> None:
        """Note which cameras see the same people by now: these have a view in common."""
        since = frame - self._settings.clustering_interval
        for group in groups:
            here = {it.key.camera for it in group.episodes if it.end.frame >= since}
            self._meeting.update(combinations(sorted(here), 2))

    def match(
        self,
        new: Sequence[Group],
        lost: Sequence[Lost],
        tables: PairTables,
        between: LooksBetween,
        frame: int,
    ) -> list[int]:
        """Say who of the lost each of the new groups is: their index, or -1."""
        asked = [self._may_be(one, other, tables, between, frame) for one in new for other in lost]
        possible = np.array(asked, dtype=np.bool_).reshape(len(new), len(lost))
        if not possible.any():
            return [-1] * len(new)
        looks = [it.looks for it in new], [it.looks for it in lost]
        first, last = [_first(it) for it in new], [it.person.sight for it in lost]
        time = self._travel.evidence(first, last)
        by_looks = find_again(between.appearances, *looks, possible, between.gate)
        nearer = np.exp(-time / self._settings.travel_appearance_weight)
        found = find_again(between.appearances, *looks, possible, between.gate, nearer)
        for i, match in enumerate(by_looks):
            if match < 0:
                continue
            # Only what looks alone say teaches times, or these would prove themselves.
            self._travel.learn(last[match], first[i])
            if (
                found[i] < 0
                and match not in found
                and time[i, match] > -self._settings.maximum_travel_evidence / 2.0
            ):
                found[i] = match
        return found

    def _may_be(self, new: Group, lost: Lost, tables: PairTables, between: LooksBetween, frame: int) -> bool:
        """Say whether looks and time alone may tell that somebody is one of the lost."""
        before = lost.group
        if before is None:
            # Who has no group though they are compared with everybody is in somebody else's.
            return lost.person.last < frame - self._settings.comparable_frames
        # Where there was something to compare by, grouping has had its say.
        compared = bool(new.cameras & before.cameras) or (
            between.share_ground(new.cameras, before.cameras) and self._share_view(new, before)
        )
        return not compared and not tables.any_apart(new.rows, before.rows)

    def _share_view(self, one: Group, two: Group) -> bool:
        pairs = {(min(a, b), max(a, b)) for a in one.cameras for b in two.cameras}
        return not pairs.isdisjoint(self._meeting)


def _first(new: Group) -> Sight:
    """Give where and when somebody was seen first."""
    frame, camera = min((it.begin.frame, it.key.camera) for it in new.episodes)
    return Sight(camera, frame)
