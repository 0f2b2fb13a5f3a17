"""Other sites: people who walk from one into another keep their number.

Twice a second the leading service of a site publishes whom it sees or has seen last (`PeoplePublisher`). The
others add them to whom they know: who has left there counts as lost here, and is matched with who arrives, by
appearance and by how long people take between cameras of the two (`bestview.association.registry`). Each site
assigns every *n*-th number, so no two people have the same; whom two sites see at once is a conflict
(`NumberConflicts`).

Messages only come from the routers that this site has connected to, by `sites.link`: it believes these sites.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

import msgspec

from server.config.site_config import Config
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS
from server.messaging.site_people import MESSAGE_BYTES_MAX, VERSION, SitePeople
from server.service.bus_connection import BusConnection
from server.service.identity.person_tracker import PersonTracker
from server.service.identity.state_recovery import SINGLE_CAMERA_NUMBER_MAX
from server.service.identity.state_replication import StateReplication
from server.service.other_sites.deletions import SiteDeletions
from server.service.other_sites.last_sightings import LastSighting, LastSightings
from server.service.other_sites.linked_site import SILENT_S, LinkedSite, reference_histogram_of
from server.service.other_sites.number_conflicts import NumberConflicts
from server.service.other_sites.numbering_ledger import NumberingLedger
from server.service.other_sites.people_here import PeopleHere
from server.service.other_sites.people_publisher import PeoplePublisher
from server.service.pulse_follower import PulseFollower
from server.service.replication.service_replication import ServiceReplication

log = logging.getLogger(__name__)

_INTERVAL_S = 0.5
UNHEARD_S = 30.0
"""Seconds without a word of a site after which that is logged."""
_PEOPLE = msgspec.msgpack.Decoder(SitePeople)


class OtherSites:
    """Receives who is at other sites, and has `publisher` tell them who is here."""

    def __init__(
        self,
        config: Config,
        people: PersonTracker,
        state_replication: StateReplication,
        replication: ServiceReplication,
        bus: BusConnection,
        pulses: PulseFollower,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        settings = config.sites
        self._config, self._people, self._state_replication = config, people, state_replication
        self._replication, self._bus, self._clock = replication, bus, clock
        self._pulses = pulses
        self.sites = {name: LinkedSite(name, link) for name, link in settings.link.items()}
        self.last_sightings = LastSightings(settings.people_max)
        self._here = PeopleHere(people, config.site.fps)
        self.publisher = PeoplePublisher(config, people, self._here, bus)
        self._conflicts = NumberConflicts(config, people, self._here)
        self._ledger = NumberingLedger(config.record.folder)
        self._deletions = SiteDeletions(settings.ids, self._ledger)
        self._ledger_changed = False
        self._writing: asyncio.Future[None] | None = None
        self._due = 0.0
        self._began = clock()
        self.bad_messages = 0
        replication.on_added.append(self._deletions.add)

    @property
    def is_alone(self) -> bool:
        """Whether there are no other sites: nothing is published."""
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
        dropped = self.last_sightings.drop(there, now)
        self._forget([number for number in dropped if number not in self._people.registry.first_seen])
        since = self._state_replication.numbers_since
        if self._replication.leads and since:
            deletions = self._deletions.to_publish(self._state_replication.forgotten, since)
            self.publisher.publish(found, self._pulse, since, deletions)
        if self._ledger_changed and self._ledger.has_file:
            self._ledger_changed = False
            self._writing = asyncio.get_running_loop().run_in_executor(None, self._ledger.write)

    def receive(self, name: str, message: Message) -> None:
        """Receive a site's message about its people."""
        site = self.sites[name]
        try:
            if len(message.payload) > MESSAGE_BYTES_MAX:
                raise msgspec.ValidationError("too long")
            report = _PEOPLE.decode(message.payload)
        except DECODE_ERRORS:
            self.bad_messages += 1
            return
        if not self._accepts(site, report):
            return
        site.heard_at = now = self._clock()
        own_since = self._state_replication.numbers_since
        renumbered = site.has_renumbered(report.numbered_since)
        if renumbered is None:
            return
        if renumbered:
            self._forget_numbers_of(report.index)
        site.index, site.numbered_since = report.index, report.numbered_since
        site.viewers = report.viewers or site.viewers
        if own_since:
            self._ledger_changed |= self._ledger.add(own_since, report.index, report.numbered_since)
            for deletion in report.deletions:
                for own in self._deletions.to_own(deletion, self._with_merged):
                    self._replication.follow_deletion(own)
        if (pulse := self._pulse) >= 0:
            self._add_people(site, report, pulse, now)

    def whereabouts(self) -> list[LastSighting]:
        """Return the last sightings of who was seen last by another site that is there, by number."""
        now, found = self._clock(), {}
        for sighting in self.last_sightings.by_number.values():
            number = self._people.registry.current(sighting.number)
            last = self._people.registry.last_seen.get(number)
            is_here = self._here.arrived(number) is not None or (last is not None and sighting.frame <= last)
            if self.sites[sighting.site].is_there(now) and not is_here:
                found[number] = replace(sighting, number=number)
        return [sighting for _, sighting in sorted(found.items())]

    def numbered_since(self, number: int) -> float:
        """Return since when a number means one person, here and at its site; infinite: unknown."""
        own, ids = self._state_replication.numbers_since, self._config.sites.ids
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

    def _accepts(self, site: LinkedSite, report: SitePeople) -> bool:
        """Return whether a site's numbers fit; log once why not."""
        own, reason = self._config.sites, ""
        same = [
            other.name
            for other in self.sites.values()
            if other is not site and other.heard_at is not None and other.index == report.index
        ]
        if report.version != VERSION:
            reason = (
                f"its version of the protocol is {report.version}, this site's {VERSION}: update the older"
            )
        elif report.of != own.of:
            reason = f"its sites.of is {report.of}, this site's {own.of}: set the same in all sites"
        elif report.index == own.index or same:
            other = same[0] if same else "this one"
            reason = f"it has the same sites.index as {other}, {report.index}: give each its own"
        if reason != site.refused:
            site.refused = reason
            log.error("site %s: refused: %s", site.name, reason) if reason else log.info(
                "site %s: accepted", site.name
            )
        return not reason

    def _add_people(self, site: LinkedSite, report: SitePeople, pulse: int, now: float) -> None:
        if site.reference_histogram is None or report.reference_histogram is not None:
            site.reference_histogram = reference_histogram_of(report)
        gone = self._state_replication.deleted(self._state_replication.numbers_since)
        newest = [
            sighting
            for sighting in self.last_sightings.put(site, report, pulse, self._config.site.fps, now)
            if sighting.number not in gone
        ]
        self.last_sightings.forget(gone)
        own = [sighting.number for sighting in newest if self._people.ids.has(sighting.number)]
        most = max(SINGLE_CAMERA_NUMBER_MAX, self._people.identity.next_id)
        self._people.identity.reserve_below(min(max(own, default=0) + 1, most))
        histograms = self.last_sightings.histograms_of(site, report.histograms)
        sightings = [
            sighting.for_registry(histograms.pop(sighting.number, None))
            for sighting in newest
            if not self._conflicts.check(site, sighting, leads=self._replication.leads)
        ]
        sightings += [
            self.last_sightings.by_number[number].for_registry(histogram)
            for number, histogram in histograms.items()
        ]
        references = {} if site.reference_histogram is None else {site.name: site.reference_histogram}
        self._people.identity.add_site_sightings(sightings, references)

    def _forget_numbers_of(self, index: int) -> None:
        """Forget people of a site whose numbers have begun anew, but who is here: it will not use theirs."""
        series = replace(self._people.ids, index=index)
        known = [*self._people.registry.all_numbers, *self.last_sightings.by_number]
        numbers = sorted(
            {number for number in known if series.has(number) and self._here.arrived(number) is None}
        )
        self._forget(numbers)
        self._people.forget(numbers)

    def _forget(self, numbers: Iterable[int]) -> None:
        gone = list(numbers)
        self.last_sightings.forget(gone)
        if gone:
            self._people.identity.forget(gone)

    def _follow_silent_sites(self, now: float) -> None:
        for site in self.sites.values():
            if site.heard_at is not None and not site.is_there(now, SILENT_S):
                left = self.last_sightings.leave_silent_site(site)
                self._people.identity.add_site_sightings([sighting.for_registry() for sighting in left], {})
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
        if own_since == self._state_replication.numbers_since:
            current = {registry.current(number) for number in numbers}
            all_of_them.update(current, *map(registry.aliases, current))
        return sorted(all_of_them)
