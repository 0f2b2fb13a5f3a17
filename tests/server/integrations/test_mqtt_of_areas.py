"""Services of areas at a real MQTT broker: each tells its own, and who walks on is told by one of them."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

from fakes.integrations.home_assistant import problems_of
from fakes.integrations.mqtt_broker import Topics, broker, cable, listening, needs_mosquitto
from fakes.service.scripted_cameras import CAMERAS, SMALL, FedService, TrackNumbers, small_config
from server.integrations.integrations import integrating
from server.integrations.mqtt.site_state import person_key
from server.messaging.messages import Box
from server.service.identity.sharding import AreaSighting, ShardingByArea
from server.service.service import BestViewService

pytestmark = [needs_mosquitto]

AREAS = [{"cameras": ["c0"], "also": ["c1"]}, {"cameras": ["c1"], "also": ["c0"]}]
SQUARE = [[0, 0], [64, 0], [64, 48], [0, 48]]
ZONES = [{"id": "all", "camera": "c0", "area": SQUARE}]
RULES = [{"id": "busy", "kind": "crowded", "zone": "all", "more_than": 0, "hold_s": 0.04}]
KEY = person_key("Ann")
ANN, ANNS_DEVICE = f"myview/hall/people/{KEY}/state", f"homeassistant/device/myview_hall_person_{KEY}/config"
STATUS = ["myview/hall/areas/0/status", "myview/hall/areas/1/status"]


class LongService(FedService):
    frames = 200


class TwoServices:
    """Both services, which hear each other after every epoch."""

    def __init__(self, *ports: int) -> None:
        self.pipelines: list[LongService] = []
        for index, port in enumerate(ports):
            sharding = {"of": 2, "index": index, "areas": AREAS}
            mqtt = {"host": "127.0.0.1", "port": port, "pictures_every_s": 0}
            config = small_config(view={"sharding": sharding}, mqtt=mqtt, zones=ZONES, rules=RULES)
            pipeline = LongService(config.of_service())
            pipeline.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
            pipeline.connect_cameras(*CAMERAS)
            self.pipelines.append(pipeline)
        self._epoch = 0

    def areas(self) -> list[ShardingByArea]:
        found = [pipeline.decider.people.sharding for pipeline in self.pipelines]
        return [area for area in found if isinstance(area, ShardingByArea)]

    def feed(self, epochs: int, seen: Mapping[str, Mapping[int, Box | None]]) -> None:
        """Let both cameras see people for some epochs, and the services say to each other who is there."""
        for _ in range(epochs):
            for pipeline in self.pipelines:
                pipeline.feed(self._epoch, {camera: seen.get(camera, {}) for camera in CAMERAS})
            self._epoch += 1
            there = [dict(area.present) for area in self.areas()]
            for index, area in enumerate(self.areas()):
                other = 1 - index
                area.set_sightings(
                    {
                        number: AreaSighting(other, here, is_visible=True)
                        for number, here in there[other].items()
                    }
                )

    def name(self, number: int, name: str) -> None:
        """Name a person, as the snapshots of a site's former single service do."""
        for pipeline in self.pipelines:
            pipeline.decider.people.registry.set_name(number, name)


@asynccontextmanager
async def two_services(*ports: int) -> AsyncIterator[TwoServices]:
    services = TwoServices(*ports)
    async with AsyncExitStack() as stack:
        for pipeline in services.pipelines:
            await stack.enter_async_context(integrating(BestViewService(pipeline)))
        yield services
    for pipeline in services.pipelines:
        pipeline.close()


def has(**wanted: Any) -> Any:
    def matches(payload: bytes) -> bool:
        content = json.loads(payload or b"{}")
        return all(content.get(name) == value for name, value in wanted.items())

    return matches


async def state_is(topics: Topics, area: int, **wanted: Any) -> None:
    await topics.until(f"myview/hall/areas/{area}/state", has(**wanted))


async def test_each_area_tells_its_own_people_and_cameras(tmp_path: Path) -> None:
    async with broker(tmp_path) as run, listening(run.port, "myview/#", "homeassistant/#") as topics:
        async with two_services(run.port, run.port) as services:
            services.feed(5, {"c0": {1: SMALL, 2: SMALL}, "c1": {1: None, 2: None, 3: SMALL}})
            await state_is(topics, 0, people=2, zones={"all": 2})
            await state_is(topics, 1, people=1, zones={"all": 0})
            await topics.until("myview/hall/areas/0/rules/busy/state", lambda payload: payload == b"ON")
            await topics.until("myview/hall/areas/1/rules/busy/state", lambda payload: payload == b"OFF")
            for camera in CAMERAS:
                await topics.until(f"myview/hall/cameras/{camera}/state", bool)
            for area, status in enumerate(STATUS):
                await topics.until(status, lambda payload: payload == b"online")
                await topics.until(f"homeassistant/device/myview_hall_area_{area}/config", bool)
        for status in STATUS:
            await topics.until(status, lambda payload: payload == b"offline")
    devices = {name: json.loads(text) for name, text in topics.newest.items() if name.endswith("/config")}
    assert [problem for topic, message in devices.items() for problem in problems_of(topic, message)] == []
    available = {topic.split("/")[2]: message["availability_topic"] for topic, message in devices.items()}
    assert available == {
        "myview_hall_area_0": STATUS[0],
        "myview_hall_area_1": STATUS[1],
        "myview_hall_camera_c0": STATUS[0],
        "myview_hall_camera_c1": STATUS[1],
    }
    ids = [part["unique_id"] for message in devices.values() for part in message["components"].values()]
    assert len(ids) == len(set(ids))
    assert all(topics.counts[f"myview/hall/cameras/{camera}/state"] <= 2 for camera in CAMERAS)


async def test_the_last_will_is_of_one_area(tmp_path: Path) -> None:
    async with (
        broker(tmp_path) as run,
        cable(run.port) as line,
        two_services(line.port, run.port),
        listening(run.port, *STATUS) as topics,
    ):
        for status in STATUS:
            await topics.until(status, lambda payload: payload == b"online")
        line.cut()
        await topics.until(STATUS[0], lambda payload: payload == b"offline")
        assert topics.newest[STATUS[1]] == b"online"
        await topics.until(STATUS[0], lambda payload: payload == b"online")


async def test_a_named_person_who_walks_on_is_one_entity_of_one_area_at_a_time(tmp_path: Path) -> None:
    async with (
        broker(tmp_path) as run,
        listening(run.port, ANN, ANNS_DEVICE, "myview/hall/areas/+/state") as topics,
        two_services(run.port, run.port) as services,
    ):
        services.feed(5, {"c0": {1: SMALL}})
        services.name(1, "Ann")
        await topics.until(ANN, has(presence="ON", camera="c0", area=0))
        await topics.until(ANNS_DEVICE, has(availability_topic=STATUS[0]))
        services.feed(3, {"c1": {1: SMALL}})  # known to both
        await topics.until(ANN, has(presence="ON", camera="c1", area=0))
        await state_is(topics, 1, people=0)
        services.feed(12, {"c1": {1: SMALL}})
        await topics.until(ANN, has(presence="ON", camera="c1", area=1))
        await topics.until(ANNS_DEVICE, has(availability_topic=STATUS[1]))
        await state_is(topics, 0, people=0)
        await state_is(topics, 1, people=1)
        told = topics.counts[ANN]
        services.feed(12, {"c0": {1: SMALL}})
        await topics.until(ANN, has(presence="ON", camera="c0", area=0))
        await topics.until(ANNS_DEVICE, has(availability_topic=STATUS[0]))
        assert topics.counts[ANN] <= told + 2, "no area answers the other"
    assert b"" not in topics.newest.values(), "nothing was removed"


async def test_an_area_that_starts_says_nothing_about_who_is_in_the_other(tmp_path: Path) -> None:
    async with broker(tmp_path) as run, listening(run.port, "myview/#") as topics:
        there, left = b'{"presence":"ON","area":1}', b'{"presence":"ON","area":0}'
        bob = f"myview/hall/people/{person_key('Bob')}/state"
        await topics._client.publish(ANN, there, qos=1, retain=True)
        await topics._client.publish(bob, left, qos=1, retain=True)
        async with two_services(run.port):
            await topics.until(bob, has(presence="OFF", area=0))
        assert topics.newest[ANN] == there
