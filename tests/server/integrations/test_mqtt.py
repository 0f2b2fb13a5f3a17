"""A site at a real MQTT broker: states, discovery, events, commands; its end, its return and the broker's."""

from __future__ import annotations

import asyncio
import gc
import json
import logging
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from fakes.http.certificates import make_certificate
from fakes.integrations.home_assistant import problems_of
from fakes.integrations.mqtt_broker import broker, cable, listening, needs_mosquitto
from fakes.service.scripted_cameras import CAMERAS, FedService, TrackNumbers, small_config, thumbnail
from fakes.timeouts import PATIENCE
from server.integrations.integrations import integrating
from server.integrations.mqtt.site_state import person_key
from server.messaging.messages import Box
from server.service.facade.people import RenamePerson
from server.service.service import BestViewService

pytestmark = [needs_mosquitto]

A, B = CAMERAS
LEFT: Box = (2.0, 10.0, 8.0, 28.0)
RIGHT: Box = (50.0, 10.0, 56.0, 28.0)
ZONE = {"id": "right", "camera": "c0", "area": [[32, 0], [64, 0], [64, 48], [32, 48]], "hold_s": 0.04}
RULES = [
    {"id": "in", "kind": "entered", "zone": "right"},
    {"id": "busy", "kind": "crowded", "zone": "right", "more_than": 0, "hold_s": 0.04},
]
SITE_CONFIG = "homeassistant/device/myview_hall/config"
REMOVED = b'"rule_busy":{"platform":"binary_sensor"}'
ANN = f"myview/hall/people/{person_key('Ann')}/state"


@asynccontextmanager
async def site(port: int, **mqtt: Any) -> AsyncIterator[BestViewService]:
    sections: dict[str, Any] = {"zones": [ZONE], "rules": RULES, **mqtt.pop("sections", {})}
    settings = {"host": "127.0.0.1", "port": port, "pictures_every_s": 0, **mqtt}
    pipeline = FedService(small_config(mqtt=settings, **sections))
    pipeline.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    pipeline.connect_cameras(*CAMERAS)
    service = BestViewService(pipeline)
    service.pipeline = pipeline  # type: ignore[attr-defined]
    async with integrating(service):
        yield service
    pipeline.close()


def feed(service: BestViewService, boxes: list[Box], first: int = 0) -> None:
    pipeline: FedService = service.pipeline  # type: ignore[attr-defined]
    for epoch, box in enumerate(boxes, first):
        if epoch == 1:
            pipeline.ingest.receive_thumbnail(thumbnail(A, 1, b"\xff\xd8 picture", pulse=4))
        pipeline.feed(epoch, {A: {1: box}, B: {}})


async def logged(caplog: pytest.LogCaptureFixture, text: str) -> None:
    while text not in caplog.text.lower():  # noqa: ASYNC110 — a log has no event
        await asyncio.sleep(0.02)


def is_json(**wanted: Any) -> Any:
    def matches(payload: bytes) -> bool:
        content = json.loads(payload or b"{}")
        return all(content.get(name) == value for name, value in wanted.items())

    return matches


async def test_states_discovery_and_events_reach_the_broker(tmp_path: Path) -> None:
    async with broker(tmp_path) as run, listening(run.port, "myview/#", "homeassistant/#") as topics:
        async with site(run.port) as service:
            await topics.until("myview/hall/status", lambda payload: payload == b"online")
            await topics.until(SITE_CONFIG, bool)
            feed(service, [LEFT, LEFT, RIGHT, RIGHT, RIGHT])
            service.people.rename_person(RenamePerson(1, "Ann"))
            event = json.loads(await topics.until("myview/hall/events", is_json(rule="in")))
            assert (event["objects"], event["zone"]) == ([1], "right")
            home = json.loads(await topics.until("myview/hall/rules/in/event", bool))
            assert (home["event_type"], home["objects"]) == ("entered", [1])
            assert await topics.until("myview/hall/rules/in/picture", bool) == b"\xff\xd8 picture"
            await topics.until("myview/hall/rules/busy/state", lambda payload: payload == b"ON")
            await topics.until("myview/hall/state", is_json(people=1, zones={"right": 1}))
            await topics.until(ANN, is_json(presence="ON", zone="right", camera=A, object=1))
        await topics.until("myview/hall/status", lambda payload: payload == b"offline")
    devices = {name: json.loads(text) for name, text in topics.newest.items() if name.endswith("/config")}
    assert len(devices) == 1 + len(CAMERAS) + 1
    assert [problem for topic, message in devices.items() for problem in problems_of(topic, message)] == []


async def test_the_last_will_says_offline(tmp_path: Path) -> None:
    async with (
        broker(tmp_path) as run,
        cable(run.port) as line,
        site(line.port),
        listening(run.port, "myview/hall/status") as topics,
    ):
        await topics.until("myview/hall/status", lambda payload: payload == b"online")
        line.cut()
        await topics.until("myview/hall/status", lambda payload: payload == b"offline")
        await topics.until("myview/hall/status", lambda payload: payload == b"online")


async def test_a_broker_that_restarts_gets_it_all_again(tmp_path: Path) -> None:
    async with broker(tmp_path) as run, site(run.port) as service:
        async with listening(run.port, "myview/#") as topics:
            await topics.until("myview/hall/state", bool)
        await run.stop()
        feed(service, [LEFT, LEFT, RIGHT, RIGHT, RIGHT])
        await run.start()
        async with listening(run.port, "myview/#", "homeassistant/#") as topics:
            await topics.until("myview/hall/status", lambda payload: payload == b"online")
            await topics.until("myview/hall/events", is_json(rule="in"))
            await topics.until("myview/hall/state", is_json(people=1))
            await topics.until(SITE_CONFIG, bool)


async def test_home_assistant_is_told_again_when_it_starts(tmp_path: Path) -> None:
    async with (
        broker(tmp_path) as run,
        site(run.port),
        listening(run.port, "homeassistant/device/#") as topics,
    ):
        await topics.until(SITE_CONFIG, bool)
        count = topics.counts[SITE_CONFIG]
        await topics._client.publish("homeassistant/status", b"online", qos=1)
        async with asyncio.timeout(PATIENCE):
            while topics.counts[SITE_CONFIG] <= count:
                topics.newest.pop(SITE_CONFIG)
                await topics.until(SITE_CONFIG, bool)


@pytest.mark.parametrize("operate", [True, False])
async def test_recording_is_switched_by_who_may_operate(tmp_path: Path, *, operate: bool) -> None:
    recorded = {"record": {"folder": str(tmp_path / "recorded")}}
    async with (
        broker(tmp_path) as run,
        listening(run.port, "myview/#", "homeassistant/#") as topics,
        site(run.port, operate=operate, sections=recorded) as service,
    ):
        await topics.until("myview/hall/state", is_json(recording="ON"))
        message = json.loads(await topics.until(SITE_CONFIG, bool))
        platform = message["components"]["recording"]["platform"]
        await topics._client.publish("myview/hall/recording/set", b"OFF", qos=1)
        if operate:
            await topics.until("myview/hall/state", is_json(recording="OFF"))
            assert (platform, service.recordings.status.is_on) == ("switch", False)
            await topics._client.publish("myview/hall/recording/set", b"ON", qos=1)
            await topics.until("myview/hall/state", is_json(recording="ON"))
        else:
            feed(service, [LEFT, LEFT, LEFT])
            await topics.until("myview/hall/state", is_json(people=1))
            assert (platform, service.recordings.status.is_on) == ("binary_sensor", True)


async def test_people_of_an_earlier_run_are_absent(tmp_path: Path) -> None:
    async with broker(tmp_path) as run, listening(run.port, "myview/#") as topics:
        await topics._client.publish(ANN, b'{"presence": "ON"}', qos=1, retain=True)
        async with site(run.port):
            await topics.until(ANN, is_json(presence="OFF", object=None))


async def test_a_reload_removes_what_is_gone(tmp_path: Path) -> None:
    async with (
        broker(tmp_path) as run,
        listening(run.port, "myview/#", "homeassistant/#") as topics,
        site(run.port) as service,
    ):
        await topics.until(SITE_CONFIG, lambda payload: b"rule_busy" in payload)
        pipeline: FedService = service.pipeline  # type: ignore[attr-defined]
        config = pipeline.config
        pipeline.apply_config(config.model_copy(update={"rules": config.rules[:1]}))
        removed = json.loads(await topics.until(SITE_CONFIG, lambda payload: REMOVED in payload))
        assert removed["components"]["rule_in"]["name"] == "in"
        await topics.until(SITE_CONFIG, lambda payload: b"rule_busy" not in payload)
        await topics.until("myview/hall/rules/busy/state", lambda payload: payload == b"")


async def test_without_a_broker_the_service_runs_and_the_log_has_no_password(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    (tmp_path / "passwords").write_text("hall:$7$nothing\n", encoding="utf-8")
    (tmp_path / "passwords").chmod(0o644)
    (tmp_path / "password").write_text("hidden-secret\n", encoding="utf-8")
    lines = ["allow_anonymous false"]
    async with (
        broker(tmp_path, *lines) as run,
        site(run.port, username="hall", password=str(tmp_path / "password")) as service,
        asyncio.timeout(PATIENCE),
    ):
        await logged(caplog, "not authorized")
        feed(service, [LEFT, LEFT, LEFT])
        assert len(service.people.list_people()) == 1
    assert "hidden-secret" not in caplog.text


async def test_the_connection_may_be_encrypted(tmp_path: Path) -> None:
    tls = make_certificate(tmp_path / "tls", "localhost")
    lines = ["allow_anonymous true", f"certfile {tls.certificate}", f"keyfile {tls.key}"]
    context = ssl.create_default_context(cafile=tls.certificate)
    async with (
        broker(tmp_path, *lines) as run,
        site(run.port, tls=True, authority=str(tls.certificate)),
        listening(run.port, "myview/#", tls_context=context) as topics,
    ):
        await topics.until("myview/hall/status", lambda payload: payload == b"online")


@pytest.mark.filterwarnings("ignore:Exception ignored in:pytest.PytestUnraisableExceptionWarning")
async def test_a_broker_with_another_certificate_is_refused(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tls, other = (make_certificate(tmp_path / name, "localhost") for name in ("tls", "other"))
    lines = ["allow_anonymous true", f"certfile {tls.certificate}", f"keyfile {tls.key}"]
    async with (
        broker(tmp_path, *lines) as run,
        site(run.port, tls=True, authority=str(other.certificate)),
        asyncio.timeout(PATIENCE),
    ):
        await logged(caplog, "certificate")
    assert "connected" not in caplog.text
    caplog.clear()
    gc.collect()  # Paho leaves the socket of a failed handshake to the garbage collector, which warns
