"""The people whom this site sees or has seen last, as is published to other sites."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from bestview.association.appearance.histograms import MeanHistogram
from server.messaging.camera_identity_snapshot import PERSON_NUMBER_MAX
from server.service.identity.person_tracker import PersonTracker
from tracking.frame_rate import frames_in

VISIBLE_S = 1.0
"""Seconds unseen after which a person has left."""


@dataclass(frozen=True, slots=True)
class PersonHere:
    """A person.

    Attributes:
        number: as published.
        ids: the automatic numbers that operators have merged into it, and itself.
        camera: that has seen them last.
        last_seen: pulse.
        is_visible: whether a camera sees them now.
    """

    number: int
    ids: tuple[int, ...]
    camera: str
    last_seen: int
    is_visible: bool


class PeopleHere:
    """Finds the people here, and remembers since when each has been here."""

    def __init__(self, people: PersonTracker, fps: float) -> None:
        self._people, self._unseen = people, frames_in(VISIBLE_S, fps)
        self._arrived: dict[int, int] = {}
        """By number, the pulse at which a person was found to be here without a break since."""

    def find(self) -> list[PersonHere]:
        """Return everybody whom this site has seen last, by number."""
        registry, newest = self._people.registry, self._people.newest
        ids: dict[int, list[int]] = {}
        places: dict[int, tuple[int, str]] = {}
        for person in self._people.identity.people:
            number = registry.current(person.person_id)
            if person.elsewhere or not person.camera or number > PERSON_NUMBER_MAX:
                continue
            if "/" in person.camera:  # of another site: receivers would refuse the whole message
                continue
            ids.setdefault(number, []).append(person.person_id)
            places[number] = max(places.get(number, (-1, "")), (person.last_frame, person.camera))
        found = []
        for number, (final, camera) in sorted(places.items()):
            last_seen = max(final, registry.last_seen.get(number, -1))
            is_visible = last_seen >= newest - self._unseen
            found.append(PersonHere(number, tuple(ids[number]), camera, last_seen, is_visible))
        return found

    def update(self, found: Iterable[PersonHere]) -> None:
        """Remember since when these people have been here."""
        newest, visible = self._people.newest, [person.number for person in found if person.is_visible]
        self._arrived = {number: self._arrived.get(number, newest) for number in visible}

    def arrived(self, number: int) -> int | None:
        """Return the pulse since which a person has been here; None: they are not."""
        return self._arrived.get(number)

    def histograms(self, found: Collection[PersonHere]) -> dict[int, MeanHistogram]:
        """Return these people's mean histograms over the cameras, by number, as far as known."""
        by_id = self._people.identity.mean_histograms([each for person in found for each in person.ids])
        histograms: dict[int, MeanHistogram] = {}
        for person in found:
            for each in person.ids:
                if each in by_id:
                    histograms[person.number] = by_id[each].added_to(histograms.get(person.number))
        return histograms
