"""A site's services have the same numbers: one that starts takes over the state; one that differs follows."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping

import msgspec
import pytest
from prometheus_client import CollectorRegistry

from fakes.service.held_association import hold, release_when_waited_for
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    LARGE,
    SMALL,
    STRIDE,
    FedService,
    camera_tracks,
    epoch_of,
    small_config,
    tracks,
)
from fakes.timeouts import PATIENCE
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import Box, ZenohKeys
from server.messaging.service_record import DeletedPerson, ServiceRecord, ServiceState
from server.service.deletion.memory_removal import forget_people
from server.service.ingest.epoch_aligner import Epoch
from server.service.metrics.service_collector import ServiceCollector
from server.service.replication.service_replication import LEASE_S

A, B = CAMERAS
KEYS = ZenohKeys("hall")
IDENTITY = {
    "confirmation_s": 0.04,
    "clustering_interval_s": 0.04,
    "publish_after_s": 0.04,
    "settle_after_s": 0.6,
    "gap_s": 0.4,
    "departed_after_s": 1.0,
}
Seen = Mapping[str, Mapping[int, Box | None]]


class Network:
    """What services say to each other, and who is there."""

    def __init__(self) -> None:
        self.present: dict[int, Callable[[Message], None]] = {}
        self.records: list[ServiceRecord] = []

    def send(self, index: int, payload: bytes) -> None:
        self.records.append(msgspec.msgpack.decode(payload, type=ServiceRecord))
        for other, receive in self.present.items():
            if other != index:
                receive(Message(KEYS.bestview("record", index), payload, b""))


class NetworkEnd:
    """Stands in for a service's connection to the others."""

    def __init__(self, network: Network, index: int) -> None:
        self._network, self._index = network, index

    @property
    def other_services(self) -> set[int]:
        return set(self._network.present) - {self._index}

    def publish_record(self, payload: bytes) -> None:
        self._network.send(self._index, payload)


class Services:
    """Services of a site that a test feeds with the same or different windows."""

    def __init__(self) -> None:
        self.network = Network()
        self.running: dict[int, FedService] = {}
        self.now = 0.0

    def start(self, index: int, *, takes_over_from: int | None = None) -> FedService:
        """Start a service."""
        sharding = {"index": index, "servers": [f"http://127.0.0.1:{port}/" for port in (1, 2)]}
        service = FedService(small_config(view={"sharding": sharding, "identity": IDENTITY}))
        replication = service.replication
        replication._bus = NetworkEnd(self.network, index)  # type: ignore[assignment]
        replication._clock = lambda: self.now
        if takes_over_from is not None:
            state = msgspec.msgpack.decode(
                self.running[takes_over_from].replication._encoded_state(), type=ServiceState
            )
            replication.restore(state)
        service.connect_cameras(*CAMERAS)
        self.network.present[index] = replication.receive
        self.running[index] = service
        return service

    def stop(self, index: int) -> None:
        self.network.present.pop(index)
        self.running.pop(index).close()

    def feed(self, epochs: range, seen: Seen, *indices: int) -> None:
        """Send all or some services the windows of some epochs."""
        for epoch in epochs:
            for index in indices or self.running:
                service = self.running[index]
                for camera in CAMERAS:
                    boxes = seen.get(camera, {})
                    service.ingest.receive_tracks(tracks(camera_tracks(camera, epoch, boxes)))
                service.pulses.newest = end_of_epoch(epoch, STRIDE)
                service.decide()

    def numbers(self, index: int, epoch: int) -> dict[tuple[str, int], int | None]:
        """Return the person of each camera's tracks 1 to 9 at the end of an epoch."""
        people, pulse = self.running[index].decider.people, end_of_epoch(epoch, STRIDE)
        named = {
            (camera, track): people.person_of(camera, 1, track, pulse)
            for camera in CAMERAS
            for track in range(1, 10)
        }
        return {track: number for track, number in named.items() if number is not None}

    def delete(self, index: int, number: int) -> None:
        """Delete a person's data on one service."""
        service = self.running[index]
        forget_people(service, [number])
        since = service.state_replication.numbers_since
        deletion = DeletedPerson(numbers=[number], numbers_since=since, deletes_media=False)
        service.replication.add_deletion(deletion)


@pytest.fixture
def services() -> Iterator[Services]:
    services = Services()
    yield services
    for service in services.running.values():
        service.close()


async def test_a_service_that_starts_has_the_numbers_of_the_running_one(services: Services) -> None:
    services.start(0)
    services.feed(range(10), {A: {8: SMALL}})  # somebody who leaves: numbers do not begin with 1
    services.feed(range(10, 20), {A: {1: SMALL, 2: LARGE}, B: {3: SMALL}})
    services.start(1, takes_over_from=0)
    services.feed(range(20, 30), {A: {1: SMALL, 2: LARGE}, B: {3: SMALL}})
    numbers = {track: number for track, number in services.numbers(0, 29).items() if track != (A, 8)}
    assert services.numbers(1, 29) == numbers
    assert len(set(numbers.values())) == 3
    assert [services.running[index].decider.people.identity.next_id for index in (0, 1)] == [5, 5]
    services.stop(0)
    services.feed(range(30, 40), {A: {1: SMALL, 2: LARGE, 4: SMALL}, B: {3: SMALL}})
    assert services.numbers(1, 39) == numbers | {(A, 4): 5}


async def test_people_who_were_away_at_the_start_return_with_their_number(services: Services) -> None:
    services.start(0)
    services.feed(range(20), {A: {3: SMALL, 5: LARGE}})
    services.feed(range(20, 60), {A: {5: LARGE}})
    first = services.numbers(0, 19)
    services.start(1, takes_over_from=0)
    assert services.running[1].decider.people.registry.departed == {first[A, 3]}
    services.feed(range(60, 90), {A: {5: LARGE, 11: SMALL}})  # track 11 has the coat of track 3
    people = [services.running[index].decider.people for index in (0, 1)]
    pulse = end_of_epoch(89, STRIDE)
    assert [known.person_of(A, 1, 11, pulse) for known in people] == [first[A, 3]] * 2
    assert services.running[1].replication.followed == 0


async def test_a_service_that_numbered_people_otherwise_follows_the_leading_one(services: Services) -> None:
    services.start(0)
    services.start(1)
    services.feed(range(10), {A: {1: SMALL}}, 0)
    services.feed(range(10), {A: {2: LARGE}}, 1)  # it received other windows
    services.feed(range(10, 12), {A: {1: SMALL, 2: LARGE}})
    assert services.numbers(0, 11) == {(A, 1): 1, (A, 2): 2}
    assert services.numbers(1, 11) == {(A, 1): 2, (A, 2): 1}
    services.feed(range(12, 30), {A: {1: SMALL, 2: LARGE}})
    assert services.numbers(1, 29) == services.numbers(0, 29) == {(A, 1): 1, (A, 2): 2}
    assert [services.running[index].replication.followed for index in (0, 1)] == [0, 1]
    services.feed(range(30, 40), {A: {1: SMALL, 2: LARGE}, B: {3: SMALL}})
    assert services.numbers(1, 39) == services.numbers(0, 39)


@pytest.mark.parametrize("asked", [0, 1])
async def test_a_person_deleted_on_one_service_is_deleted_on_all(services: Services, asked: int) -> None:
    seen: Seen = {A: {1: SMALL, 2: LARGE}, B: {3: LARGE}}
    for index in (0, 1):
        service = services.start(index)
        service.replication.on_deletion.append(
            lambda deletion, service=service: forget_people(service, deletion.numbers)
        )
    services.feed(range(20), seen)
    ann = services.numbers(0, 19)[A, 1]
    assert ann is not None
    assert services.numbers(1, 19)[A, 1] == ann
    services.running[1 - asked].decider.people.registry.set_name(ann, "Ann")
    services.delete(asked, ann)
    services.feed(range(20, 60), seen)
    for index in (0, 1):
        people = services.running[index].decider.people
        assert ann not in people.registry.all_numbers
        assert ann not in people.registry.merged
        assert people.registry.names == {}
    assert services.numbers(0, 59) == services.numbers(1, 59)
    assert ann not in services.numbers(0, 59).values()
    services.stop(asked)
    later = services.start(asked, takes_over_from=1 - asked)
    deleted: list[DeletedPerson] = []
    later.replication.on_deletion.append(deleted.append)
    services.feed(range(60, 70), seen)
    assert [each.numbers for each in deleted] == [[ann]], "a service that was off is told"
    assert ann not in later.decider.people.registry.all_numbers


async def test_each_of_many_deletions_is_followed_once(services: Services) -> None:
    followed: list[tuple[int, int]] = []
    for index in (0, 1):
        services.start(index).replication.on_deletion.append(
            lambda deletion, index=index: followed.append((index, *deletion.numbers))
        )
    services.feed(range(10), {A: {1: SMALL}})
    for turn in range(3):
        for index in (0, 1):
            for number in range(1000, 1030):
                deletion = DeletedPerson(
                    numbers=[number + 100 * turn + 1000 * index], numbers_since=1.0, deletes_media=False
                )
                services.running[index].replication.add_deletion(deletion)
        services.feed(range(10 + 40 * turn, 50 + 40 * turn), {A: {1: SMALL}})
    assert len(followed) == len(set(followed)) == 2 * 3 * 30


async def test_the_service_that_has_decided_every_epoch_for_longest_leads(services: Services) -> None:
    services.start(0)
    services.feed(range(10), {A: {1: SMALL}})
    assert services.running[0].replication.leads
    services.start(1, takes_over_from=0)
    services.feed(range(10, 20), {A: {1: SMALL}})
    assert [services.running[index].replication.leads for index in (0, 1)] == [True, False]
    services.feed(range(20, 30), {A: {1: SMALL}}, 1)
    services.feed(range(30, 50), {A: {1: SMALL}})
    assert [services.running[index].replication.leads for index in (0, 1)] == [False, True]
    services.stop(1)
    assert services.running[0].replication.leads
    metrics = CollectorRegistry()
    metrics.register(ServiceCollector(services.running[0], {}))
    assert metrics.get_sample_value("myview_leads") == 1
    assert (
        metrics.get_sample_value("myview_followed_records_total") == services.running[0].replication.followed
    )


async def test_a_service_that_is_cut_off_from_the_cameras_does_not_lead_but_one_whose_tracks_are_late_does(
    services: Services,
) -> None:
    a_second = round(FPS / STRIDE)
    services.start(0)
    services.feed(range(10), {A: {1: SMALL}})
    services.start(1, takes_over_from=0)
    services.feed(range(10, 20), {A: {1: SMALL}})
    for epoch in range(20, 20 + 2 * a_second):
        services.feed(range(epoch, epoch + 1), {A: {1: SMALL}}, 1)
        tracks_of = {} if epoch < 19 + a_second else {A: camera_tracks(A, epoch, {1: SMALL})}
        services.running[0].replication.step(Epoch(epoch, end_of_epoch(epoch, STRIDE), tracks_of))
        assert services.running[0].replication.leads, epoch
    for epoch in range(20 + 2 * a_second, 20 + 4 * a_second):
        services.feed(range(epoch, epoch + 1), {A: {1: SMALL}}, 1)
        services.running[0].replication.step(Epoch(epoch, end_of_epoch(epoch, STRIDE), {}))
    assert [services.running[index].replication.leads for index in (0, 1)] == [False, True]


async def test_a_silent_service_does_not_lead_for_longer_than_its_lease(services: Services) -> None:
    services.start(0)
    services.feed(range(10), {A: {1: SMALL}})
    services.start(1, takes_over_from=0)
    services.feed(range(10, 20), {A: {1: SMALL}})
    services.feed(range(20, 30), {A: {1: SMALL}}, 1)
    assert not services.running[1].replication.leads
    services.now += LEASE_S
    assert services.running[1].replication.leads


@pytest.mark.parametrize("payload", [b"", b"{", b"[]", b'{"service": 64}', b"\xff"])
async def test_an_invalid_record_is_counted_and_ignored(services: Services, payload: bytes) -> None:
    services.start(0)
    services.running[0].replication.receive(Message(KEYS.bestview("record", 1), payload, b""))
    services.feed(range(10), {A: {1: SMALL}})
    assert services.running[0].replication.bad_messages == 1
    assert services.running[0].replication.leads


async def test_a_state_that_is_asked_for_during_an_association_is_that_after_it(services: Services) -> None:
    services.start(0)
    services.start(1)
    services.feed(range(10), {A: {1: SMALL}})
    service = services.running[0]
    people = service.decider.people
    released = hold(people)
    messages = [camera_tracks(camera, 10, {1: SMALL, 2: LARGE}) for camera in CAMERAS]
    associating = asyncio.create_task(people.associate(epoch_of(10, *messages)))
    await asyncio.sleep(0)
    release_when_waited_for(people, released)
    state = msgspec.msgpack.decode(service.replication._encoded_state(), type=ServiceState)
    assert state.record.pulse == end_of_epoch(10, STRIDE)
    people.update(epoch_of(10, *messages))
    later = msgspec.msgpack.decode(service.replication._encoded_state(), type=ServiceState)
    assert later == state
    assert len(state.record.cameras[B].people) == 2
    async with asyncio.timeout(PATIENCE):
        await associating
