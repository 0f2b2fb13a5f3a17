"""Target for what other sites tell about people."""

from __future__ import annotations

from functools import partial
from itertools import count
from random import Random

import msgspec
import numpy as np

from benchmarks.fuzz.bus.damaged_messages import damaged_message
from benchmarks.fuzz.engine.fed_site import CAMERAS, FPS, HEIGHT, STRIDE, WIDTH, make_tracks, site
from benchmarks.fuzz.engine.target import ScriptTarget
from server.config.sections import LinkSettings, SitesSettings
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import ZenohKeys
from server.messaging.packed_arrays import pack_histograms
from server.messaging.site_people import (
    PersonHistogram,
    SightingRow,
    SiteDeletion,
    SitePeople,
    TokenDigest,
    Viewers,
    pack_reference_histogram,
    pack_sightings,
)
from server.service.bus_connection import BusConnection
from server.service.identity.person_tracker import PersonTracker
from server.service.identity.state_replication import StateReplication
from server.service.ingest.epoch_aligner import Epoch
from server.service.other_sites.other_sites import OtherSites
from server.service.pulse_follower import PulseFollower
from server.service.replication.service_replication import ServiceReplication

_MESSAGES = 6
_BINS = 96
_script = msgspec.msgpack.Decoder(tuple[int, list[tuple[str, bytes]]])
_OTHERS = {1: "yard", 2: "shop"}


class OtherSitesMessages(ScriptTarget):
    """Messages of two other sites, some of them damaged, while people are tracked."""

    name = "bus-other-sites"

    def __init__(self) -> None:
        links = {
            name: LinkSettings(connect="tcp/127.0.0.1:1", url=f"http://{name}/") for name in _OTHERS.values()
        }
        self._config = site().model_copy(update={"sites": SitesSettings(of=3, link=links)})

    def make(self, rng: Random) -> bytes:
        """Return some messages, and the seed of the people here."""
        script = []
        for _ in range(_MESSAGES):
            index = rng.choice(list(_OTHERS))
            payload = msgspec.msgpack.encode(self._message(rng, index))
            message = Message(ZenohKeys(_OTHERS[index]).bestview("people"), payload, b"")
            sent = damaged_message(rng, message) if rng.random() < 0.5 else message
            script.append((_OTHERS[index], sent.payload))
        return msgspec.msgpack.encode((rng.randrange(1000), script))

    @staticmethod
    def _message(rng: Random, index: int) -> SitePeople:
        numbers = rng.sample(range(1, 30), rng.randrange(6))
        rows = [SightingRow(number, "c0", 9 * rng.random(), rng.choice((None, 5.0))) for number in numbers]
        histograms = np.random.default_rng(rng.randrange(99)).dirichlet(np.ones(_BINS), len(numbers))
        return SitePeople(
            index=index,
            of=3,
            numbered_since=float(rng.randrange(1, 3)),
            cameras=["c0"],
            people=pack_sightings(rows, ["c0"]),
            histograms=[
                PersonHistogram(number=number, frames=25, histogram=pack_histograms(histogram))
                for number, histogram in zip(numbers, histograms, strict=True)
            ],
            reference_histogram=pack_reference_histogram(
                histograms.sum(axis=0) if numbers else np.zeros(_BINS)
            ),
            deletions=[
                SiteDeletion(index=index, numbered_since=1.0, numbers=[index + 1], deletes_media=False)
            ]
            * rng.randrange(2),
            viewers=rng.choice((None, Viewers(tokens=[TokenDigest(bytes(16))]))),
        )

    def feed(self, data: bytes) -> bool:
        """Take in the messages, with people here in between."""
        seed, script = _script.decode(data)
        config, rng = self._config, Random(seed)
        people = PersonTracker(
            config.view.identity, CAMERAS, dict.fromkeys(CAMERAS), (WIDTH, HEIGHT), 0, ids=config.sites.ids
        )
        bus, pulses = BusConnection(config), PulseFollower(config)
        state_replication = StateReplication(people, CAMERAS, FPS, lambda _, __: None)
        replication = ServiceReplication(config, people, state_replication, bus)
        sites = OtherSites(
            config, people, state_replication, replication, bus, pulses, clock=partial(next, count(0.0))
        )
        for epoch, (name, payload) in enumerate(script):
            self.messages += 1
            last = end_of_epoch(epoch, STRIDE)
            windows = {camera: make_tracks(rng, camera, epoch) for camera in CAMERAS}
            people.update(Epoch(epoch, last, windows))
            pulses.newest = last
            sites.step()
            sites.receive(name, Message("", payload, b""))
            sites.whereabouts()
        known = people.identity.people
        assert len({person.person_id for person in known}) == len(known)
        assert len(sites.last_sightings.by_number) <= config.sites.people_max
        return not (sites.bad_messages or any(linked.refused for linked in sites.sites.values()))
