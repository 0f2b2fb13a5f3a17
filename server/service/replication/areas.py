"""Services that divide a site by area: whom two of them see has one number, and is served where they are."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping

import msgspec

from server.config.sections import ShareSettings
from server.messaging.service_record import ServiceRecord
from server.service.identity.people import PersonTracker
from server.service.identity.sharding import PeopleOfArea
from server.service.replication.disagreements import (
    Disagreements,
    find_disagreements,
    follow,
    numbers_of_tracks,
    snapshots_without,
)

log = logging.getLogger(__name__)

_WAITING_MAX = 30
"""Records of a service that wait until this one is at their pulse, at most."""


class AreaAgreement:
    """Compares records with those of the services of other areas, by the tracks of the cameras they share.

    A person has the number of the service in whose area they are; if they are in both, of the one that saw
    them first, and of equal ones the lower number. So no number is ever asked for, and somebody who walks on
    keeps theirs.
    """

    def __init__(self, share: ShareSettings, people: PersonTracker) -> None:
        self._share, self._people = share, people
        self._last_found: dict[int, Disagreements] = {}
        """By area, what its last record would change."""
        self._waiting: dict[int, dict[int, ServiceRecord]] = {}
        """By service and pulse, records that are not compared yet."""

    def is_other(self, record: ServiceRecord) -> bool:
        """Return whether a record is of a service of another area."""
        return bool(self._share.areas) and record.service % self._share.of != self._share.share

    def present(self) -> dict[int, int]:
        """Return since when each person in the area has been known, by number."""
        area, seen = self._people.of_service, self._people.registry.first_seen
        if not isinstance(area, PeopleOfArea):
            return {}
        return {number: max(seen[number], 0) for number in sorted(area.present) if number in seen}

    def receive(self, record: ServiceRecord) -> None:
        """Keep a record of another area until this service is at its pulse."""
        if self.is_other(record):
            waiting = self._waiting.setdefault(record.service, {})
            waiting[record.pulse] = record
            for pulse in sorted(waiting)[:-_WAITING_MAX]:
                del waiting[pulse]

    def step(self, own: Mapping[int, ServiceRecord], live: Iterable[ServiceRecord]) -> list[ServiceRecord]:
        """Take in who is in the other areas, and take over their numbers where two records in a row say so.

        Args:
            own: this service's newest records, by pulse.
            live: the other services' newest ones.

        Returns:
            The records by which a number has changed.
        """
        area = self._people.of_service
        if not isinstance(area, PeopleOfArea):
            return []
        others = [record for record in live if self.is_other(record)]
        area.hear({number: record.service % self._share.of for record in others for number in record.in_area})
        changed = []
        for record in others:
            waiting = self._waiting.get(record.service, {})
            pulses = sorted(waiting.keys() & own.keys())
            changed += [record for pulse in pulses if self._follow(own[pulse], waiting[pulse])]
            newest = max(own, default=-1)
            self._waiting[record.service] = {p: each for p, each in waiting.items() if p > newest}
        return changed

    def _follow(self, own: ServiceRecord, other: ServiceRecord) -> bool:
        """Take over the numbers of people in another area; return whether any has changed.

        Both records are of one pulse.
        """
        area = other.service % self._share.of
        found = find_disagreements(own.cameras, snapshots_without(other.cameras, _not_followed(own, other)))
        agreed = found.common(self._last_found.get(area, Disagreements()))
        self._last_found[area] = found
        if agreed:
            follow(self._people, agreed)
            log.debug("people's numbers of area %d: %s", area, msgspec.json.encode(agreed).decode())
        return bool(agreed)


def _not_followed(own: ServiceRecord, other: ServiceRecord) -> set[int]:
    """Return whose numbers in another area's record do not count: they are not there, or came from here."""
    own_numbers = numbers_of_tracks(own.cameras)
    skipped = set[int]()
    for track, number in numbers_of_tracks(other.cameras).items():
        known = own_numbers.get(track)
        if number not in other.in_area or (
            known in own.in_area and (own.in_area[known], known) <= (other.in_area[number], number)
        ):
            skipped.add(number)
    return skipped
