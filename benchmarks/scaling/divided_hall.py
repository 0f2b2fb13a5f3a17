"""Services that divide a simulated hall by area, in one process: who has which number, and processor time.

The person trackers, the filters of the areas and the agreement about numbers are those of the best-view
service; what the services say to each other is encoded and decoded as on the bus.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import scipy.optimize

from benchmarks.scaling.simulated_hall import (
    FPS,
    HEIGHT,
    STRIDE,
    WIDTH,
    WINDOW,
    SimulatedHall,
    SimulatedTracker,
)
from bestview import FloorAreas
from server.config.site_config import Config
from server.messaging.inbox import Message
from server.messaging.messages import CameraTracks, ZenohKeys
from server.service.bus_connection import BusConnection
from server.service.identity.person_tracker import PersonTracker
from server.service.identity.service_area import ingest_area
from server.service.identity.sharding import create_sharding
from server.service.identity.state_replication import StateReplication
from server.service.ingest.epoch_aligner import Epoch
from server.service.replication.service_replication import ServiceReplication

_MARGIN_M = 5.0
_DECIDED_EPOCHS = 5
"""After which the person behind a track does not change any more."""
_KEPT_EPOCHS = 6
_KEYS = ZenohKeys("hall")

SeenTrack = tuple[str, int]
"""A camera, and its track."""


@dataclass(frozen=True, slots=True)
class Observed:
    """What the cameras of a hall send in an epoch, and who their tracks are."""

    messages: Mapping[str, CameraTracks]
    people: Mapping[SeenTrack, int]


def observe(hall: SimulatedHall, epochs: int) -> list[Observed]:
    """Simulate the cameras of a hall."""
    trackers = [SimulatedTracker(hall, camera, 1) for camera in range(hall.cameras)]
    found = []
    for epoch in range(epochs):
        last = (epoch + 1) * STRIDE - 1
        places = hall.places(max(0, last + 1 - WINDOW), last)
        messages = {tracker.camera: tracker.message(epoch, places) for tracker in trackers}
        people = {
            (tracker.camera, track): person
            for tracker in trackers
            for track, person in tracker.visible(epoch).items()
        }
        found.append(Observed(messages, people))
    return found


def divide(hall: SimulatedHall, services: int) -> list[dict[str, Any]]:
    """Return the setting `view.sharding.areas` of so many services; empty: one has the whole hall."""
    if services == 1:
        return []
    grounds = dict(zip(hall.ids, hall.grounds, strict=True))
    areas = FloorAreas(grounds, dict.fromkeys(hall.ids, (WIDTH, HEIGHT)), services)
    return [
        {
            "cameras": list(areas.cameras_of(area)),
            "also": list(areas.also_seen_by(area)),
            "floor": areas.floor_of(area),
            "margin": _MARGIN_M,
        }
        for area in range(services)
    ]


class _Exchange:
    """What services say to each other; it arrives after all have processed an epoch."""

    def __init__(self) -> None:
        self.receivers: dict[int, Callable[[Message], None]] = {}
        self.size = 0
        self._waiting: list[tuple[int, bytes]] = []

    def send(self, index: int, payload: bytes) -> None:
        """Send a record to the other services."""
        self.size += len(payload)
        self._waiting.append((index, payload))

    def deliver(self) -> None:
        """Let everything arrive."""
        for sender, payload in self._waiting:
            for index, receive in self.receivers.items():
                if index != sender:
                    receive(Message(_KEYS.bestview("record", sender), payload, b""))
        self._waiting.clear()

    def end(self, index: int) -> BusConnection:
        """Return a service's connection to the others."""
        return cast("BusConnection", _End(self, index))


@dataclass(slots=True)
class _End:
    exchange: _Exchange
    index: int

    @property
    def other_services(self) -> set[int]:
        return set(self.exchange.receivers) - {self.index}

    def publish_record(self, payload: bytes) -> None:
        self.exchange.send(self.index, payload)


class DividedService:
    """One of the services."""

    def __init__(
        self, hall: SimulatedHall, index: int, areas: Sequence[dict[str, Any]], exchange: _Exchange
    ) -> None:
        sharding = {"of": len(areas), "index": index, "areas": areas} if areas else {}
        config = Config.model_validate(
            {
                "site": {"name": "hall", "fps": FPS, "width": WIDTH, "height": HEIGHT},
                "track": {"joint": False},
                "cameras": [{"id": camera, "source": f"rtsp://{camera}/"} for camera in hall.ids],
                "view": {"sharding": sharding},
            }
        ).of_service()
        self.cameras = config.camera_ids
        grounds = dict(zip(hall.ids, hall.grounds, strict=True))
        self.people = PersonTracker(
            config.view.identity,
            self.cameras,
            {camera: grounds[camera] for camera in self.cameras},
            (WIDTH, HEIGHT),
            WINDOW - STRIDE,
            create_sharding(config, grounds),
            fps=FPS,
            ids=config.person_numbers,
        )
        self._area = ingest_area(config, grounds)
        state_replication = StateReplication(
            self.people, self.cameras, FPS, lambda _camera, _payload: None, clock=lambda: 0.0
        )
        self._replication = ServiceReplication(
            config, self.people, state_replication, exchange.end(index), clock=lambda: 0.0
        )
        exchange.receivers[index] = self._replication.receive
        self.seconds = 0.0

    def step(self, number: int, observed: Observed) -> None:
        """Process an epoch."""
        tracks = {camera: observed.messages[camera] for camera in self.cameras}
        epoch = Epoch(number, (number + 1) * STRIDE - 1, tracks)
        began = time.process_time()
        if self._area is not None:
            epoch = self._area.without_far_people(epoch)
        self.people.update(epoch)
        self._replication.step(epoch)
        self.people.forget_before((number - _KEPT_EPOCHS) * STRIDE)
        self.seconds += time.process_time() - began

    def numbers(self, number: int, observed: Observed) -> dict[SeenTrack, int]:
        """Return the number behind each track of this service's people, in a frame that is decided."""
        pulse = (number + 1 - _DECIDED_EPOCHS) * STRIDE - 1
        own, found = set(self.people.known), {}
        for camera, track in observed.people:
            if camera in self.cameras:
                person = self.people.person_of(camera, 1, track, pulse)
                if person is not None and person in own:
                    found[camera, track] = person
        return found


@dataclass(slots=True)
class DividedRun:
    """What services have found.

    Attributes:
        cameras: that each service takes in.
        busiest_ms: processor milliseconds a frame of the service that needs most.
        sum_ms: of all services together.
        record_kb: kilobytes of records that they send to each other in a second.
        numbers: by epoch, each track's number; of a track with several, all.
        changes: how often a person's number changed.
        doubled: how often a person had two numbers at once, in a person and an epoch.
    """

    cameras: list[int]
    busiest_ms: float
    sum_ms: float
    record_kb: float
    numbers: list[dict[SeenTrack, set[int]]] = field(default_factory=list)
    changes: int = 0
    doubled: int = 0


def run_divided(hall: SimulatedHall, observed: Sequence[Observed], services: int) -> DividedRun:
    """Let services divide a hall."""
    exchange, areas = _Exchange(), divide(hall, services)
    running = [DividedService(hall, index, areas, exchange) for index in range(services)]
    run = DividedRun([len(service.cameras) for service in running], 0.0, 0.0, 0.0)
    before: dict[int, set[int]] = {}
    for number, seen in enumerate(observed):
        for service in running:
            service.step(number, seen)
        exchange.deliver()
        tracks: dict[SeenTrack, set[int]] = {}
        people: dict[int, set[int]] = {}
        for service in running:
            for track, person in service.numbers(number, seen).items():
                tracks.setdefault(track, set()).add(person)
                people.setdefault(seen.people[track], set()).add(person)
        run.numbers.append(tracks)
        run.doubled += sum(len(found) > 1 for found in people.values())
        run.changes += sum(not found & before.get(person, found) for person, found in people.items())
        before |= people
    frames = len(observed) * STRIDE
    run.busiest_ms = 1e3 * max(service.seconds for service in running) / frames
    run.sum_ms = 1e3 * sum(service.seconds for service in running) / frames
    run.record_kb = exchange.size / 1e3 / frames * FPS
    return run


def agreement(whole: Mapping[SeenTrack, set[int]], divided: Mapping[SeenTrack, set[int]]) -> float:
    """Return the share of tracks that have the same person in both, whatever the numbers are, from 0 to 1."""
    pairs = [(one, other) for track in whole for one in whole[track] for other in divided.get(track, {-1})]
    first, row = np.unique([one for one, _ in pairs], return_inverse=True)
    second, column = np.unique([other for _, other in pairs], return_inverse=True)
    common = np.zeros((len(first), len(second)))
    np.add.at(common, (row, column), 1.0)
    common[:, second == -1] = 0.0
    return float(
        common[scipy.optimize.linear_sum_assignment(common, maximize=True)].sum() / max(len(pairs), 1)
    )
