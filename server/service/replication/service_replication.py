"""Keeps the people's numbers of a site's best-view services equal, whichever of them dies or starts.

Services of one shard compute the same identities from the same messages. Where they differ, since a
message was lost or late to one of them, the others follow the leading service. Which one leads follows from
the records alone: the one that has decided every epoch for longest. When its liveliness token is gone, or no
record came for `LEASE_S`, the next one leads. A service that was stopped, or cut off from the cameras, has a
later beginning when it returns, and so follows.

Where services divide a site by area, each sends its record after every epoch (`areas`).
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from server.config.site_config import Config
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS
from server.messaging.service_record import (
    DELETIONS_MAX,
    RECORD_BYTES_MAX,
    DeletedPerson,
    ServiceRecord,
    ServiceState,
)
from server.service.bus_connection import BusConnection
from server.service.identity.person_tracker import PersonTracker
from server.service.identity.state_recovery import RECENT_S, state_for_cameras
from server.service.identity.state_replication import StateReplication
from server.service.ingest.epoch_aligner import Epoch
from server.service.replication.areas import AreaAgreement
from server.service.replication.disagreements import (
    Disagreements,
    find_disagreements,
    follow,
    numbers_of_tracks,
)
from server.service.replication.state import restore_people, state_of

log = logging.getLogger(__name__)

LEASE_S = 3.0
"""Seconds for which a record counts."""
_INTERVAL_S = 1.0
"""Seconds between two records."""
_CONNECT_S = 1.0
"""How long a service that starts waits for the others' sessions; those that are down do not come."""
_STATE_S = 2.0
"""How long it waits for their states."""
_CUT_OFF_S = 1.0
"""Seconds without any camera's tracks after which a service counts as cut off from them: on a busy machine
they are sometimes late in one service and not in another."""
_OWN_RECORDS = 30
"""Own records kept, to be compared with the others' of the same pulse."""
_NUMBERS_AHEAD_MAX = 10_000
"""Numbers by which another service may be ahead."""
_RECORD = msgspec.msgpack.Decoder(ServiceRecord)
_STATE = msgspec.msgpack.Decoder(ServiceState)


@dataclass(frozen=True, slots=True)
class _Received:
    """The newest record of another service, and when it came, by the monotonic clock."""

    record: ServiceRecord
    at: float


class ServiceReplication:
    """Publishes this service's record, follows the leading one's, and takes over its state at the start."""

    def __init__(
        self,
        config: Config,
        people: PersonTracker,
        state_replication: StateReplication,
        bus: BusConnection,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        sharding = config.view.sharding
        self._index, self._services = sharding.index, sharding.services
        self._areas = AreaAgreement(sharding, people, config.site.fps)
        self._cameras, self._fps = config.camera_ids, config.site.fps
        self._interval = (
            1 if sharding.areas else max(1, round(_INTERVAL_S * config.site.fps / config.window.stride))
        )
        """Epochs between two records; those whose number it divides have one, in every service."""
        self._people, self._state_replication, self._bus, self._clock = people, state_replication, bus, clock
        self._received: dict[int, _Received] = {}
        self._own: dict[int, ServiceRecord] = {}
        """By pulse."""
        self._unbroken_since: int | None = None
        self._newest_epoch = -1
        self._cut_off_after = max(1, round(_CUT_OFF_S * config.site.fps / config.window.stride))
        self._empty_epochs = 0
        """The last epochs, as far as they have no tracks."""
        self._last_found = Disagreements()
        self._leader = self._index
        self.followed = 0
        """Records of the leading service whose numbers replaced own ones."""
        self.bad_messages = 0
        """Records and states that could not be parsed."""
        self._deletions: list[DeletedPerson] = []
        """The newest, which are sent."""
        self._deleted: set[tuple[float, int, bool]] = set()
        """All: since when numbers are, a number of these, and whether its media are deleted."""
        self.on_deletion: list[Callable[[DeletedPerson], None]] = []
        """Called with each deletion of another service or site."""
        self.on_added: list[Callable[[DeletedPerson], None]] = []
        """Called with each deletion that is sent."""
        self._changed = asyncio.Event()

    @property
    def leads(self) -> bool:
        """Whether this service leads."""
        return self._leading() is None

    async def take_over(self) -> None:
        """Take over the state of the leading service, where another one is running."""
        if self._services == 1:
            return
        self._bus.exchange_records(self.receive, self._encoded_state, self._on_service)
        try:
            async with asyncio.timeout(_CONNECT_S):
                while len(self._bus.other_services) < self._services - 1:
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            log.info("%d of %d services are there", 1 + len(self._bus.other_services), self._services)
        answers = await asyncio.to_thread(self._bus.query_states, _STATE_S)
        answered = [state for answer in answers if (state := self._decode_state(answer)) is not None]
        for state in answered:
            self._areas.learn_numbers(state.record)
        states = [state for state in answered if not self._areas.is_other(state.record)]
        if not states:
            return
        state = min(states, key=lambda state: state.record.rank)
        self._received[state.record.service] = _Received(state.record, self._clock())
        self.restore(state)

    def restore(self, state: ServiceState) -> None:
        """Take over a state, before the first epoch."""
        gone = self._state_replication.deleted(state.record.numbered_since)
        kept = [person for person in state.people if gone.isdisjoint([person.number, *person.aliases])]
        restore_people(self._people, msgspec.structs.replace(state, people=kept))
        self._state_replication.take_over(state.record.cameras)
        text = "took over the state of best-view service %d: %d people"
        log.info(text, state.record.service, len(state.people))

    def receive(self, message: Message) -> None:
        """Keep another service's record; it is compared once this one is at its pulse."""
        try:
            if len(message.payload) > RECORD_BYTES_MAX:
                raise msgspec.ValidationError("too long")
            record = _RECORD.decode(message.payload)
        except DECODE_ERRORS:
            self.bad_messages += 1
            return
        if record.service < self._services and record.service != self._index:
            self._received[record.service] = _Received(record, self._clock())
            self._areas.receive(record)
            for deletion in record.deletions:
                self.follow_deletion(deletion)

    def add_deletion(self, deletion: DeletedPerson) -> None:
        """Send a deletion to the other services, with every record from the next on."""
        for callback in self.on_added:
            callback(deletion)
        self._deletions = [*self._deletions, deletion][-DELETIONS_MAX:]
        self._deleted |= _deleted_numbers(deletion)
        if deletion.deletes_media:  # one without is done by it
            self._deleted |= _deleted_numbers(msgspec.structs.replace(deletion, deletes_media=False))

    def follow_deletion(self, deletion: DeletedPerson) -> None:
        """Carry out a deletion of another service or site, unless that was done."""
        if not _deleted_numbers(deletion) <= self._deleted:
            self.add_deletion(deletion)
            for callback in self.on_deletion:
                callback(deletion)

    def step(self, epoch: Epoch) -> None:
        """Publish a record where one is due, and follow the leading service, after an epoch was decided."""
        if self._services == 1:
            return
        self._empty_epochs = 0 if epoch.tracks else self._empty_epochs + 1
        is_broken = epoch.number != self._newest_epoch + 1 or self._empty_epochs >= self._cut_off_after
        if self._unbroken_since is None or is_broken:
            self._unbroken_since = epoch.last
        self._newest_epoch = epoch.number
        if epoch.number % self._interval == 0:
            record = self._record()
            self._own[epoch.last] = record
            self._own = dict(list(self._own.items())[-_OWN_RECORDS:])
            payload = msgspec.msgpack.encode(record)
            if len(payload) <= RECORD_BYTES_MAX:
                self._bus.publish_record(payload)
        self._compare()

    def _compare(self) -> None:
        """Compare the records of pulses that this service has reached with its own."""
        leader = self._leading()
        if (index := self._index if leader is None else leader.service) != self._leader:
            self._leader = index
            log.info("best-view service %d leads", index)
        live = [received.record for received in self._live()]
        self.followed += self._areas.step(self._own, live)
        for record in live:
            own = self._own.get(record.pulse)
            if self._areas.is_other(record):
                self._follow_numbering(record)
                continue
            if own is None:
                continue
            del self._own[record.pulse]
            self._reserve(own, record)
            if record is leader:
                self._follow_numbering(record)
                gone = set(self._state_replication.forgotten)
                self._follow(
                    find_disagreements(
                        numbers_of_tracks(own.cameras, gone), numbers_of_tracks(record.cameras, gone)
                    )
                )

    def _follow_numbering(self, record: ServiceRecord) -> None:
        """Count the numbers from when those of another service began.

        Between areas it is the earliest: none assigns a number that another one remembers.
        """
        since = record.numbered_since
        is_later = since >= self._state_replication.numbers_since and self._areas.is_other(record)
        if since > 0.0 and not is_later:
            self._state_replication.follow_numbering(since)

    def _follow(self, found: Disagreements) -> None:
        """Follow the leading service where two records in a row differ in the same way."""
        if found and found == self._last_found:
            follow(self._people, found)
            self.followed += 1
            log.warning(
                "people's numbers were not those of service %d: %s",
                self._leader,
                msgspec.json.encode(found).decode(),
            )
            found = Disagreements()
        self._last_found = found

    def _reserve(self, own: ServiceRecord, other: ServiceRecord) -> None:
        """Skip the numbers that another service has assigned and this one has not."""
        ahead = other.next_number - own.next_number
        if 0 < ahead <= _NUMBERS_AHEAD_MAX:
            self._people.identity.reserve_below(self._people.identity.next_id + ahead)

    def _leading(self) -> ServiceRecord | None:
        """Return the record of the leading service; None: this one leads."""
        live = min(
            (each.record for each in self._live() if not self._areas.is_other(each.record)),
            key=lambda record: record.rank,
            default=None,
        )
        if live is None:
            return None
        since = self._unbroken_since
        return live if since is None or live.rank < (since, self._index) else None

    def _live(self) -> list[_Received]:
        """Return the other services' records that count."""
        now = self._clock()
        present = self._bus.other_services
        return [
            received
            for index, received in sorted(self._received.items())
            if index in present and now < received.at + LEASE_S
        ]

    def _record(self) -> ServiceRecord:
        assert self._unbroken_since is not None  # noqa: S101 — set by the first epoch
        self._people.finish_association()  # a service that starts may ask while one runs
        newest = self._people.newest
        snapshots = state_for_cameras(
            self._people,
            self._cameras,
            newest,
            round(RECENT_S * self._fps),
            self._state_replication.numbers_since,
            self._state_replication.forgotten,
        )
        return ServiceRecord(
            service=self._index,
            pulse=newest,
            unbroken_since=self._unbroken_since,
            cameras=snapshots,
            in_area=self._areas.present(),
            next_numbers=self._areas.next_numbers,
            deletions=self._deletions,
        )

    def _encoded_state(self) -> bytes:
        """Return the state for a service that starts; empty: there is none yet."""
        if self._unbroken_since is None:
            return b""
        return msgspec.msgpack.encode(state_of(self._people, self._record()))

    def _decode_state(self, answer: bytes) -> ServiceState | None:
        try:
            state = _STATE.decode(answer) if answer else None
        except DECODE_ERRORS:
            self.bad_messages += 1
            return None
        return None if state is None or state.record.service == self._index else state

    def _on_service(self) -> None:
        self._changed.set()


def _deleted_numbers(deletion: DeletedPerson) -> set[tuple[float, int, bool]]:
    return {(deletion.numbers_since, number, deletion.deletes_media) for number in deletion.numbers}
