"""Rules over HTTP: zones and events, server-sent events, pictures, and scopes of tokens."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any

import pytest

from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, thumbnail
from fakes.timeouts import PATIENCE
from server.http.access.permissions import ALL, Scope
from server.http.api.scope_filter import filter_event
from server.messaging.messages import Box
from server.service.facade.rules import EventRecord

A, B = CAMERAS
LEFT: Box = (2.0, 10.0, 8.0, 28.0)
RIGHT: Box = (50.0, 10.0, 56.0, 28.0)
ZONE = {"id": "right", "camera": "c0", "area": [[32, 0], [64, 0], [64, 48], [32, 48]], "hold_s": 0.04}
RULES = [
    {"id": "in", "kind": "entered", "zone": "right"},
    {"id": "busy", "kind": "crowded", "zone": "right", "more_than": 0, "hold_s": 0.04},
]
EPOCHS = [LEFT, LEFT, RIGHT, RIGHT, RIGHT]


@pytest.fixture
async def site() -> AsyncIterator[ServedSite]:
    async for served in serve_site(zones=[ZONE], rules=RULES):
        served.service.connect_cameras(*CAMERAS)
        yield served


def feed(site: ServedSite) -> None:
    for epoch, box in enumerate(EPOCHS):
        if epoch == 1:
            site.service.ingest.receive_thumbnail(thumbnail(A, 1, b"\xff\xd8 picture", pulse=4))
        site.service.feed(epoch, {A: {1: box}, B: {}})


async def test_zones_rules_and_events_are_listed(site: ServedSite) -> None:
    before = await site.get_json("/api/rules")
    assert before["events"] == []
    assert [zone["objects"] for zone in before["zones"]] == [[]]
    feed(site)
    after = await site.get_json("/api/rules")
    assert [zone["objects"] for zone in after["zones"]] == [[1]]
    assert [(rule["rule"], rule["lasting"]) for rule in after["rules"]] == [("in", False), ("busy", True)]
    crowd, entered = after["events"]
    assert (entered["rule"], entered["phase"], entered["objects"], entered["pulse"]) == (
        "in",
        "once",
        [1],
        10,
    )
    assert (crowd["rule"], crowd["phase"]) == ("busy", "began")
    assert entered["clip"] == "objects/1/best.mp4?from=p0&to=p185"


async def test_an_event_has_a_picture_and_a_clip(site: ServedSite) -> None:
    feed(site)
    (_, event) = (await site.get_json("/api/rules"))["events"]
    async with site.session.get(f"/{event['picture']}") as answer:
        assert (answer.status, answer.content_type) == (200, "image/jpeg")
        assert await answer.read() == b"\xff\xd8 picture"
    assert (await site.get("/api/events/0-0-9/picture.jpg"))[0] == 404
    async with site.session.get(f"/{event['clip']}") as answer:
        assert (answer.status, answer.content_type) == (200, "video/mp4")


async def test_events_are_sent_to_listeners(site: ServedSite) -> None:
    async with site.session.get("/api/events") as answer:
        feed(site)
        async with asyncio.timeout(PATIENCE):
            async for line in answer.content:
                if line == b"event: rule\n":
                    break
            data = await answer.content.readline()
    event = json.loads(data.removeprefix(b"data: "))
    assert (event["rule"], event["objects"], event["zone"]) == ("in", [1], "right")


def record(*objects: int) -> EventRecord:
    content: dict[str, Any] = {
        "rule": "r",
        "kind": "close",
        "phase": "began",
        "zone": None,
        "objects": list(objects),
        "names": [None for _ in objects],
        "direction": None,
        "pulse": 1,
        "time": None,
        "confirmed": 2,
        "camera": None,
    }
    return EventRecord(**content, id="0-2-1", picture="api/events/0-2-1/picture.jpg", clip=None)


def test_a_token_for_one_person_hears_of_them_alone() -> None:
    merged = {5: 3}

    def resolve(number: int) -> int:
        return merged.get(number, number)

    assert filter_event(record(1, 3), ALL, resolve) == record(1, 3)
    alone = filter_event(record(3), Scope(object=5), resolve)
    assert alone is not None
    assert (alone.objects, alone.picture) == ([3], None)
    for other in (record(1), record(1, 3), record()):
        assert filter_event(other, Scope(object=3), resolve) is None
    assert filter_event(record(3), Scope(camera="c0"), resolve) is None
