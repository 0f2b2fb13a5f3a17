"""Services that divide a site by area: whom two of them see has one number, and is served where they are."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping

import msgspec

from server.config.sections import ShareSettings
from server.messaging.service_record import ServiceRecord
from server.service.identity.local_numbers import TrackName
from server.service.identity.people import PersonTracker
from server.service.identity.sharding import PeopleOfArea
from server.service.identity.track_parts import UNCONFIRMED
from server.service.replication.disagreements import (
    Disagreements,
    find_disagreements,
    follow,
    numbers_of_tracks,
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
        self._cameras = frozenset(share.cameras or ())
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

    def step(self, own: Mapping[int, ServiceRecord], live: Iterable[ServiceRecord]) -> int:
        """Take in who is in the other areas, and take over their numbers where two records in a row say so.

        Args:
            own: this service's newest records, by pulse.
            live: the other services' newest ones.

        Returns:
            The number of records by which a number has changed.
        """
        area = self._people.of_service
        if not isinstance(area, PeopleOfArea):
            return 0
        others = [record for record in live if self.is_other(record)]
        area.hear({number: record.service % self._share.of for record in others for number in record.in_area})
        newest = max(own, default=-1)
        due = []
        for record in others:
            waiting = self._waiting.get(record.service, {})
            due += [each for pulse, each in sorted(waiting.items()) if pulse in own]
            self._waiting[record.service] = {pulse: each for pulse, each in waiting.items() if pulse > newest}
        numbers = {pulse: numbers_of_tracks(own[pulse].cameras) for pulse in {each.pulse for each in due}}
        return sum(self._follow(numbers[each.pulse], own[each.pulse].in_area, each) for each in due)

    def _follow(self, own: Mapping[TrackName, int], in_area: Mapping[int, int], other: ServiceRecord) -> bool:
        """Take over the numbers of people in another area; return whether any has changed.

        Args:
            own: who the tracks are here at the pulse of the record.
            in_area: since when each person in this area has been known, by number.
            other: the other area's record.
        """
        area = other.service % self._share.of
        seen_here = {
            camera: snapshot for camera, snapshot in other.cameras.items() if camera in self._cameras
        }
        theirs = numbers_of_tracks(seen_here)
        skipped = set[int]()
        for track, number in theirs.items():
            known = own.get(track, UNCONFIRMED)
            is_older = known in in_area and (in_area[known], known) <= (
                other.in_area.get(number, 0),
                number,
            )
            if number not in other.in_area or is_older:  # not there, or they came from here
                skipped.add(number)
        found = find_disagreements(
            own, {track: number for track, number in theirs.items() if number not in skipped}
        )
        agreed = found.common(self._last_found.get(area, Disagreements()))
        self._last_found[area] = found
        if agreed:
            follow(self._people, agreed)
            log.debug("people's numbers of area %d: %s", area, msgspec.json.encode(agreed).decode())
        return bool(agreed)
