"""Sites that tell each other who is there, without a bus: a test passes each the windows of its cameras."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import msgspec

from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    STRIDE,
    FedService,
    camera_tracks,
    small_config,
    tracks,
)
from server.config.sections import LinkSettings
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import Box, ZenohKeys
from server.messaging.site_people import SitePeople

IDENTITY = {
    "confirmation_s": 0.4,
    "clustering_interval_s": 0.04,
    "publish_after_s": 0.04,
    "settle_after_s": 0.6,
    "gap_s": 0.4,
    "departed_after_s": 1.0,
    "forget_after_s": 60.0,
}
NAMES = ("hall", "yard", "shop")
Seen = Mapping[int, Box | None]


class LinkedSites:
    """Sites by name, whose pulses begin at different numbers, on one clock."""

    def __init__(self) -> None:
        self.running: dict[str, FedService] = {}
        self.told: list[tuple[str, SitePeople]] = []
        self.bytes: list[int] = []
        self.now = 0.0
        self.cut: set[str] = set()
        """Sites that are cut off from the others."""
        self._epochs: dict[str, int] = {}

    def start(self, name: str, first: int | None = None, **settings: Any) -> FedService:
        """Start a site that is linked with all others; its first epoch is `first`."""
        index = NAMES.index(name)
        links = {other: {"connect": "tcp/127.0.0.1:1", "url": f"http://{other}/"} for other in NAMES}
        del links[name]
        sites = {"of": len(NAMES), "index": index, "link": links} | settings.pop("sites", {})
        view = {"identity": IDENTITY} | settings.pop("view", {})
        service = FedService(small_config(site={"name": name}, sites=sites, view=view, **settings))
        service.other_sites._clock = lambda: self.now
        service.other_sites.publisher._bus = _End(self, name)  # type: ignore[assignment]
        service.connect_cameras(*CAMERAS)
        self.running[name] = service
        self._epochs[name] = 500 * index if first is None else first
        return service

    def stop(self, name: str) -> None:
        """Stop a site."""
        self.running.pop(name).close()

    def walk(self, seconds: float, **seen: Seen) -> None:
        """Let time pass; each site's first camera sees these tracks."""
        for _ in range(round(seconds * FPS / STRIDE)):
            for name, service in self.running.items():
                epoch = self._epochs[name] = self._epochs[name] + 1
                for camera in CAMERAS:
                    boxes = seen.get(name, {}) if camera == CAMERAS[0] else {}
                    service.ingest.receive_tracks(tracks(camera_tracks(camera, epoch, boxes)))
                service.pulses.newest = end_of_epoch(epoch, STRIDE)
                service.decide()
            self.now += STRIDE / FPS

    def number(self, name: str, track: int) -> int | None:
        """Return who a track of a site's first camera is now."""
        people = self.running[name].decider.people
        return people.person_of(CAMERAS[0], 1, track, people.newest)

    def elsewhere(self, name: str) -> dict[int, str]:
        """Return whom other sites have seen last, and where."""
        return {person.number: person.site for person in self.running[name].other_sites.whereabouts()}

    def deliver(self, sender: str, payload: bytes) -> None:
        """Deliver a message to all other sites."""
        self.told.append((sender, msgspec.msgpack.decode(payload, type=SitePeople)))
        self.bytes.append(len(payload))
        for name, service in self.running.items():
            if name != sender and not {name, sender} & self.cut:
                key = ZenohKeys(sender).bestview("people")
                service.other_sites.receive(sender, Message(key, payload, b""))


class _End:
    """Stands in for a site's connection to the bus."""

    def __init__(self, network: LinkedSites, name: str) -> None:
        self._network, self._name = network, name

    def publish_people(self, payload: bytes) -> None:
        self._network.deliver(self._name, payload)

    def link_site(self, name: str, link: LinkSettings, on_people: object) -> None:
        del name, link, on_people


@contextmanager
def linked_sites(*names: str, **settings: Any) -> Iterator[LinkedSites]:
    """Run sites, by default a hall and a yard."""
    sites = LinkedSites()
    for name in names or NAMES[:2]:
        sites.start(name, **settings)
    try:
        yield sites
    finally:
        for service in sites.running.values():
            service.close()
