"""Other sites: people who walk from one into another keep their number.

Twice a second the leading service of a site tells the others whom it sees or has seen last (`site_people`),
and takes in what they say: who has left there counts as lost here, and is matched with who arrives, by looks
and by how long people take between cameras of the two (`bestview.association.registry`). Each site assigns
every *n*-th number, so no two people have the same. If two sites still say that they see one person, the one
where they arrived later gives them a new number.

Messages only come from the routers that this site has connected to, by `sites.link`: it believes these sites.
"""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial

import msgspec

from server.config.site_config import Config
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS
from server.messaging.site_people import (
    MESSAGE_BYTES_MAX,
    SALT_BYTES,
    VERSION,
    VIEWERS_MAX,
    SitePeople,
    Viewers,
)
from server.service.bus_connection import BusConnection
from server.service.identity.people import PersonTracker
from server.service.identity.state_recovery import SINGLE_CAMERA_NUMBER_MAX
from server.service.identity.state_replication import StateReplication
from server.service.other_sites.deletions import SiteDeletions
from server.service.other_sites.message_builder import SiteMessageBuilder
from server.service.other_sites.numbering_ledger import NumberingLedger
from server.service.other_sites.people_elsewhere import (
    SILENT_S,
    LinkedSite,
    PeopleElsewhere,
    PersonElsewhere,
    population_of,
    viewers_of,
)
from server.service.other_sites.people_here import PeopleHere, PersonHere
from server.service.pulse_follower import PulseFollower
from server.service.replication.service_replication import ServiceReplication

log = logging.getLogger(__name__)

_INTERVAL_S = 0.5
_STAY_MARGIN_S = 2.0
"""Seconds by which two sites' times of arrival may be wrong."""
_CONFLICTS = 2
"""Messages in a row that say a person is at another site while they are here, before one gives way."""
UNHEARD_S = 30.0
"""Seconds without a word of a site after which that is logged."""
_PEOPLE = msgspec.msgpack.Decoder(SitePeople)

Tokens = Sequence[tuple[str, int]]
"""SHA-256 of tokens, and the only person each is for, or 0."""


class OtherSites:
    """Tells other sites who is here, and takes in what they tell."""

    def __init__(
        self,
        config: Config,
        people: PersonTracker,
        of_cameras: StateReplication,
        replication: ServiceReplication,
        bus: BusConnection,
        pulses: PulseFollower,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        settings = config.sites
        self._config, self._people, self._of_cameras = config, people, of_cameras
        self._replication, self._bus, self._clock = replication, bus, clock
        self._pulses = pulses
        self.sites = {name: LinkedSite(name, link) for name, link in settings.link.items()}
        self.elsewhere = PeopleElsewhere(settings.people_max)
        self._here = PeopleHere(people, config.site.fps)
        self._builder = SiteMessageBuilder(config, people, self._here)
        self._ledger = NumberingLedger(config.record.folder)
        self._deletions = SiteDeletions(settings.ids, self._ledger)
        self._ledger_changed = False
        self._writing: asyncio.Future[None] | None = None
        self._conflicts: dict[int, int] = {}
        """By number, messages in a row that say a person is at another site, too."""
        self._due = 0.0
        self._began = clock()
        self._salt = secrets.token_bytes(SALT_BYTES)
        self.accepted_tokens: Callable[[], Tokens | None] | None = None
        """Returns the tokens of this site's viewers; None: it needs none. Not set: nobody may know."""
        self.bad_messages = 0
        self.sent_bytes = 0
        self._has_been_too_long = False
        replication.on_added.append(self._deletions.add)

    @property
    def is_alone(self) -> bool:
        """Whether there are no other sites: nothing is told."""
        return self._config.sites.of == 1

    async def open(self) -> None:
        """Connect to the other sites' routers.

        Raises:
            UserError: a password file cannot be read, or an address is not supported.
        """
        if self.is_alone:
            return
        self._began = self._clock()
        await asyncio.to_thread(self._ledger.read)
        for name, site in self.sites.items():
            self._bus.link_site(name, site.settings, partial(self.receive, name))

    def step(self) -> None:
        """Publish what is due, after an epoch was decided."""
        if self.is_alone or self._clock() < self._due:
            return
        now = self._clock()
        self._due = now + _INTERVAL_S
        found = self._here.find()
        self._here.update(found)
        self._follow_silent_sites(now)
        there = [name for name, site in self.sites.items() if site.is_there(now)]
        dropped = self.elsewhere.drop(there, now)
        self._forget([number for number in dropped if number not in self._people.registry.first_seen])
        if self._replication.leads:
            self._publish(found)
        if self._ledger_changed and self._ledger.has_file:
            self._ledger_changed = False
            self._writing = asyncio.get_running_loop().run_in_executor(None, self._ledger.write)

    def receive(self, name: str, message: Message) -> None:
        """Take in what another site tells."""
        site = self.sites[name]
        try:
            if len(message.payload) > MESSAGE_BYTES_MAX:
                raise msgspec.ValidationError("too long")
            told = _PEOPLE.decode(message.payload)
        except DECODE_ERRORS:
            self.bad_messages += 1
            return
        if not self._accepts(site, told):
            return
        site.heard_at = now = self._clock()
        own_since = self._of_cameras.numbers_since
        renumbered = site.has_renumbered(told.numbered_since)
        if renumbered is None:
            return
        if renumbered:
            self._renumbered(told.index)
        site.index, site.numbered_since = told.index, told.numbered_since
        site.viewers = told.viewers or site.viewers
        if own_since:
            self._ledger_changed |= self._ledger.add(own_since, told.index, told.numbered_since)
            for deletion in told.deletions:
                for own in self._deletions.own(deletion, self._with_merged):
                    self._replication.follow_deletion(own)
        if (pulse := self._pulse) >= 0:
            self._take_in(site, told, pulse, now)

    def whereabouts(self) -> list[PersonElsewhere]:
        """Return who was seen last by another site that is there, by number."""
        now, found = self._clock(), {}
        for person in self.elsewhere.by_number.values():
            number = self._people.registry.current(person.number)
            last = self._people.registry.last_seen.get(number)
            is_here = self._here.arrived(number) is not None or (last is not None and person.frame <= last)
            if self.sites[person.site].is_there(now) and not is_here:
                found[number] = replace(person, number=number)
        return [person for _, person in sorted(found.items())]

    def numbered_since(self, number: int) -> float:
        """Return since when a number means one person, here and at its site; infinite: unknown."""
        own, ids = self._of_cameras.numbers_since, self._config.sites.ids
        if ids.has(number) or not own:
            return own
        index = (number - 1) % ids.step
        heard = [site.numbered_since for site in self.sites.values() if site.index == index]
        known = [since for since in heard if since is not None] or self._ledger.numberings(own, index)
        return max(own, max(known, default=math.inf))

    @property
    def now(self) -> float:
        """The time, monotonic seconds."""
        return self._clock()

    @property
    def _pulse(self) -> int:
        return max(self._pulses.newest, self._people.newest)

    def _accepts(self, site: LinkedSite, told: SitePeople) -> bool:
        """Return whether a site's numbers fit; log once why not."""
        own, reason = self._config.sites, ""
        same = [
            other.name
            for other in self.sites.values()
            if other is not site and other.heard_at is not None and other.index == told.index
        ]
        if told.version != VERSION:
            reason = f"its version of the protocol is {told.version}, this site's {VERSION}: update the older"
        elif told.of != own.of:
            reason = f"its sites.of is {told.of}, this site's {own.of}: set the same in all sites"
        elif told.index == own.index or same:
            other = same[0] if same else "this one"
            reason = f"it has the same sites.index as {other}, {told.index}: give each its own"
        if reason != site.refused:
            site.refused = reason
            log.error("site %s: refused: %s", site.name, reason) if reason else log.info(
                "site %s: accepted", site.name
            )
        return not reason

    def _take_in(self, site: LinkedSite, told: SitePeople, pulse: int, now: float) -> None:
        if site.population is None or told.population is not None:
            site.population = population_of(told)
        gone = self._of_cameras.deleted(self._of_cameras.numbers_since)
        people = [
            person
            for person in self.elsewhere.put(site, told, pulse, self._config.site.fps, now)
            if person.number not in gone
        ]
        self.elsewhere.forget(gone)
        own = [person.number for person in people if self._people.ids.has(person.number)]
        most = max(SINGLE_CAMERA_NUMBER_MAX, self._people.identity.next_id)
        self._people.identity.reserve_below(min(max(own, default=0) + 1, most))
        histograms = self.elsewhere.histograms_of(site, told.histograms)
        sightings = [
            person.sighting(histograms.pop(person.number, None))
            for person in people
            if not self._is_contested(site, person)
        ]
        sightings += [
            self.elsewhere.by_number[number].sighting(histogram) for number, histogram in histograms.items()
        ]
        populations = {} if site.population is None else {site.name: site.population}
        self._people.identity.add_remote_sightings(sightings, populations)

    def _is_contested(self, site: LinkedSite, person: PersonElsewhere) -> bool:
        """Return whether a person is here, too; where they arrived later they get a new number."""
        number = self._people.registry.current(person.number)
        arrived = self._here.arrived(number)
        if person.stay_s is None or arrived is None:
            self._conflicts.pop(number, None)
            return False
        self._conflicts[number] = self._conflicts.get(number, 0) + 1
        stay = (self._people.newest - arrived) / self._config.site.fps
        longer = person.stay_s - stay
        gives_way = longer > _STAY_MARGIN_S or (
            longer >= -_STAY_MARGIN_S and site.index < self._config.sites.index
        )
        if gives_way and self._conflicts[number] >= _CONFLICTS and self._replication.leads:
            self._give_way(number)
        return True

    def _give_way(self, number: int) -> None:
        new = self._people.split_off(number, self._config.camera_ids)
        self._conflicts.pop(number, None)
        if new is not None:
            log.warning("person %d is at another site: who is here is now %d", number, new)

    def _renumbered(self, index: int) -> None:
        """Forget people of a site whose numbers have begun anew, but who is here: it will not use theirs."""
        series = replace(self._people.ids, index=index)
        known = [*self._people.registry.all_numbers, *self.elsewhere.by_number]
        numbers = sorted(
            {number for number in known if series.has(number) and self._here.arrived(number) is None}
        )
        self._forget(numbers)
        self._people.forget(numbers)

    def _forget(self, numbers: Iterable[int]) -> None:
        gone = list(numbers)
        self.elsewhere.forget(gone)
        if gone:
            self._people.identity.forget(gone)

    def _follow_silent_sites(self, now: float) -> None:
        for site in self.sites.values():
            if site.heard_at is not None and not site.is_there(now, SILENT_S):
                left = self.elsewhere.leave_silent_site(site)
                self._people.identity.add_remote_sightings([person.sighting() for person in left], {})
            elif (
                site.heard_at is None
                and not (site.refused or site.is_missed)
                and self._began + UNHEARD_S < now
            ):
                site.is_missed = True
                log.warning(
                    "site %s: nothing heard from sites.link.%s.connect: is it up, is that its site.name, and "
                    "does its zenoh.users have this site's line?",
                    site.name,
                    site.name,
                )

    def _with_merged(self, numbers: list[int], own_since: float) -> list[int]:
        registry, all_of_them = self._people.registry, set(numbers)
        if own_since == self._of_cameras.numbers_since:
            current = {registry.current(number) for number in numbers}
            all_of_them.update(current, *map(registry.aliases, current))
        return sorted(all_of_them)

    def _publish(self, found: Sequence[PersonHere]) -> None:
        since = self._of_cameras.numbers_since
        if not since:
            return
        deletions = self._deletions.told(self._of_cameras.forgotten, since)
        payload = self._builder.build(found, self._pulse, since, deletions, self._viewers())
        if len(payload) <= MESSAGE_BYTES_MAX:
            self.sent_bytes += len(payload)
            self._bus.publish_people(payload)
        elif not self._has_been_too_long:
            self._has_been_too_long = True
            log.error("message to other sites dropped: %d bytes, at most %d", len(payload), MESSAGE_BYTES_MAX)

    def _viewers(self) -> Viewers:
        if self.accepted_tokens is None:
            return Viewers()
        tokens = self.accepted_tokens()
        return Viewers(is_open=True) if tokens is None else viewers_of(self._salt, tokens[:VIEWERS_MAX])
