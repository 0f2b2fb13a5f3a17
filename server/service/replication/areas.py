"""Agreement between the services of different areas: a person whom two of them see has one number."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import replace

import msgspec

from server.config.sections import ShardingSettings
from server.messaging.camera_identity_snapshot import PERSON_NUMBER_MAX
from server.messaging.service_record import AreaStay, ServiceRecord
from server.service.identity.local_numbers import TrackName
from server.service.identity.person_tracker import PersonTracker
from server.service.identity.sharding import AreaSighting, ShardingByArea
from server.service.identity.track_parts import UNCONFIRMED
from server.service.replication.disagreements import (
    Disagreements,
    find_disagreements,
    follow,
    numbers_of_tracks,
)
from tracking.frame_rate import frames_in

log = logging.getLogger(__name__)

_WAITING_MAX = 30
"""Records of a service that wait until this one is at their pulse, at most."""
_VISIBLE_S = 1.0
"""Seconds after which somebody whom another service has not certainly seen in its area is out of its view."""


class AreaAgreement:
    """Compares records with those of the services of other areas, by the tracks of the cameras they share.

    A person has the number of the service in whose area they are; if they are in both, of the one that saw
    them first, and of equal ones the lower number. So no number is ever asked for, and somebody who walks on
    keeps theirs.
    """

    def __init__(self, sharding: ShardingSettings, people: PersonTracker, fps: float) -> None:
        self._settings, self._people = sharding, people
        self._unseen = frames_in(_VISIBLE_S, fps)
        self._cameras = frozenset(sharding.cameras or ())
        self._next_numbers = [1] * len(sharding.areas)
        self._last_found: dict[int, Disagreements] = {}
        """By service, what its last record would change."""
        self._changed_at = -1
        """The pulse of the last change here, up to which own records say what was before."""
        self._waiting: dict[int, dict[int, ServiceRecord]] = {}
        """By service and pulse, records that are not compared yet."""

    def is_other(self, record: ServiceRecord) -> bool:
        """Return whether a record is of a service of another area."""
        return bool(self._settings.areas) and self._shard_of(record) != self._settings.shard

    def present(self) -> dict[int, AreaStay]:
        """Return since when each person in the area has been known, by number, and was there."""
        area, seen = self._people.sharding, self._people.registry.first_seen
        if not isinstance(area, ShardingByArea):
            return {}
        return {
            number: AreaStay(first_seen=max(seen[number], 0), here=max(last, 0))
            for number, last in sorted(area.present.items())
            if number in seen
        }

    @property
    def next_numbers(self) -> list[int]:
        """By area, the first number that was not assigned, as far as is known."""
        known = list(self._next_numbers)
        if known:
            known[self._settings.shard] = min(self._people.identity.next_id, PERSON_NUMBER_MAX + 1)
        return known

    def learn_numbers(self, record: ServiceRecord) -> None:
        """Assign no number that this area has assigned before, as another service remembers."""
        if not self.is_other(record) or len(record.next_numbers) != len(self._next_numbers):
            return
        self._next_numbers = [max(each) for each in zip(self._next_numbers, record.next_numbers, strict=True)]
        self._people.identity.reserve_below(record.next_numbers[self._settings.shard])

    def receive(self, record: ServiceRecord) -> None:
        """Keep a record of another area until this service is at its pulse."""
        if self.is_other(record):
            self.learn_numbers(record)
            self._learn_names(record)
            waiting = self._waiting.setdefault(record.service, {})
            waiting[record.pulse] = record
            for pulse in sorted(waiting)[:-_WAITING_MAX]:
                del waiting[pulse]

    def _learn_names(self, record: ServiceRecord) -> None:
        """Take over the names of people in another area who are known here."""
        registry = self._people.registry
        for snapshot in record.cameras.values():
            for person in snapshot.people:
                is_known = person.number in registry.first_seen and person.number not in registry.names
                if person.name and is_known and person.number in record.in_area:
                    registry.set_name(person.number, person.name)

    def step(self, own: Mapping[int, ServiceRecord], live: Iterable[ServiceRecord]) -> int:
        """Take in who is in the other areas, and take over their numbers where two records in a row say so.

        Args:
            own: this service's newest records, by pulse.
            live: the other services' newest ones.

        Returns:
            The number of records by which a number has changed.
        """
        area = self._people.sharding
        if not isinstance(area, ShardingByArea):
            return 0
        others = [record for record in live if self.is_other(record)]
        last_area_first = sorted(others, key=self._shard_of, reverse=True)
        area.set_sightings(
            {
                number: AreaSighting(
                    self._shard_of(record), stay.here, record.pulse - stay.here <= self._unseen
                )
                for record in last_area_first
                for number, stay in record.in_area.items()
            }
        )
        newest = max(own, default=-1)
        due = []
        for record in others:
            waiting = self._waiting.get(record.service, {})
            due += [each for pulse, each in sorted(waiting.items()) if pulse in own]
            self._waiting[record.service] = {pulse: each for pulse, each in waiting.items() if pulse > newest}
        numbers = {pulse: numbers_of_tracks(own[pulse].cameras) for pulse in {each.pulse for each in due}}
        return sum(self._follow(numbers[each.pulse], own[each.pulse].in_area, each) for each in due)

    def _shard_of(self, record: ServiceRecord) -> int:
        return self._settings.shard_of_service(record.service)

    def _follow(
        self, own: Mapping[TrackName, int], in_area: Mapping[int, AreaStay], other: ServiceRecord
    ) -> bool:
        """Take over the numbers of people in another area; return whether any has changed.

        Args:
            own: who the tracks are here at the pulse of the record.
            in_area: who is in this area, by number.
            other: the other area's record.
        """
        if other.pulse <= self._changed_at:
            return False
        seen_here = {
            camera: snapshot for camera, snapshot in other.cameras.items() if camera in self._cameras
        }
        theirs = numbers_of_tracks(seen_here)
        skipped = {
            number
            for track, number in theirs.items()
            if _is_older(own.get(track, UNCONFIRMED), in_area, number, other.in_area)
        }
        found = find_disagreements(
            own, {track: number for track, number in theirs.items() if number not in skipped}
        )
        agreed = found.common(self._last_found.get(other.service, Disagreements()))
        self._last_found[other.service] = found
        agreed = replace(agreed, renumbered=self._free(agreed))
        if not agreed:
            return False
        follow(self._people, agreed)
        self._changed_at = self._people.newest
        self._last_found.clear()
        log.debug("people's numbers of service %d: %s", other.service, msgspec.json.encode(agreed).decode())
        return True

    def _free(self, found: Disagreements) -> dict[int, int]:
        """Return the new numbers that nobody else has here: who has one keeps it."""
        registry = self._people.registry
        present = registry.first_seen.keys() - registry.departed
        return {
            old: new
            for old, new in found.renumbered.items()
            if new not in present or found.renumbered.get(new, new) != new
        }


def _is_older(own: int, in_area: Mapping[int, AreaStay], number: int, there: Mapping[int, AreaStay]) -> bool:
    """Return whether a number of another area does not count: nobody has it there, or they came from here."""
    if number not in there:
        return True
    return own in in_area and (in_area[own].first_seen, own) <= (there[number].first_seen, number)
