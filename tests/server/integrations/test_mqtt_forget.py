"""A deleted person is in no further message to the MQTT broker."""

from __future__ import annotations

import asyncio
import json
from typing import Any

from fakes.timeouts import PATIENCE
from server.config.sections import MqttSettings
from server.integrations.mqtt.publisher import MqttPublisher
from server.service.facade.rules import EventRecord, PicturedEvent


class Reader:
    site, area = "hall", None


async def test_a_person_deleted_while_an_event_is_published_is_in_no_further_message() -> None:
    publisher = MqttPublisher(MqttSettings(host="127.0.0.1"), Reader(), None)  # type: ignore[arg-type]
    sent: list[tuple[str, bytes]] = []
    done = asyncio.Event()

    class Broker:
        async def publish(self, topic: str, payload: bytes, *_: Any) -> None:
            if not sent:
                publisher.forget([3])
            sent.append((topic.rpartition("/")[2], payload))
            if topic.endswith("/event"):
                done.set()

    record = EventRecord(
        rule="in",
        kind="entered",
        phase="once",
        zone="till",
        objects=[3, 5],
        names=["Ann", None],
        direction=None,
        pulse=100,
        time="2026-11-26T17:00:00.000Z",
        confirmed=110,
        camera="c0",
        id="19abc-110-1",
        picture="picture.jpg",
        clip="clip.mp4",
    )
    publisher.put_event(PicturedEvent(record, b"\xff\xd8"))
    publishing = asyncio.create_task(publisher._publish_events(Broker()))  # type: ignore[arg-type]
    async with asyncio.timeout(PATIENCE):
        await done.wait()
    publishing.cancel()
    await asyncio.wait({publishing})
    topics = [topic for topic, _ in sent]
    assert topics == ["events", "events", "event"]
    assert [json.loads(payload)["objects"] for _, payload in sent] == [[3, 5], [5], [5]]
