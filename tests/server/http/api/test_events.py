"""Server-sent events: the current state first, then every GOP before its video."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import aiohttp

from fakes.service.fed_site import A, B, ServedSite
from fakes.service.scripted_cameras import CAMERAS, GOP, LARGE, SMALL
from fakes.timeouts import PATIENCE
from server.http.access.permissions import ALL
from server.http.api.events import Audience, Events
from server.service.service import BestViewService


async def events(answer: aiohttp.ClientResponse, count: int) -> list[tuple[str, Any]]:
    received: list[tuple[str, Any]] = []
    name = ""
    while len(received) < count:
        line = (await answer.content.readline()).decode().rstrip("\n")
        if line.startswith("event: "):
            name = line.removeprefix("event: ")
        elif line.startswith("data: "):
            received.append((name, json.loads(line.removeprefix("data: "))))
    return received


async def test_events_begin_with_the_current_state_and_continue_with_every_gop(
    site_with_people: ServedSite,
) -> None:
    async with site_with_people.session.get("/api/events") as answer:
        assert answer.content_type == "text/event-stream"
        received = await events(answer, 6)
        assert [name for name, _ in received] == ["site", "objects", "cameras", "delays", "gop", "gop"]
        assert [content["first"] for _, content in received[4:]] == [0, GOP]
        assert received[1][1] == await site_with_people.get_json("/api/objects")
        site_with_people.service.feed(3, {A: {1: LARGE, 2: SMALL}, B: {1: None}})
        while (event := (await events(answer, 1))[0])[0] != "gop":
            pass
    gop = event[1]
    assert gop["choices"] == {"1": B, "2": A}
    assert gop["boxes"][B] == [[[1, *LARGE]]] * GOP
    assert gop["cuts"] == []


async def test_a_cut_event_has_both_cameras(site_with_people: ServedSite) -> None:
    for epoch in range(3, 6):
        site_with_people.service.feed(epoch, {A: {1: LARGE}, B: {}})
    async with site_with_people.session.get("/api/events") as answer:
        received = await events(answer, 7)
    cuts = [cut for name, content in received if name == "gop" for cut in content["cuts"]]
    assert cuts == [{"object": 1, "pulse": 3 * GOP, "from": B, "to": A}]


async def test_the_event_of_a_gop_is_sent_before_its_video(served: ServedSite) -> None:
    order: list[str] = []
    served.service.on_decision.append(lambda _: order.append("event"))
    sent = served.service.splicer.publish_decision

    def decision(choices: Any) -> None:
        order.append("sent")
        sent(choices)

    served.service.splicer.publish_decision = decision  # type: ignore[method-assign,assignment]
    served.service.connect_cameras(*CAMERAS)
    for epoch in range(4):
        served.service.feed(epoch, {A: {1: SMALL}, B: {}})
    assert order == ["event", "sent"] * 3


async def test_a_subscriber_that_fell_behind_receives_the_current_state_again(
    site_with_people: ServedSite,
) -> None:
    received = Events(BestViewService(site_with_people.service))
    reader = received.join(Audience(ALL))
    for epoch in range(3, 120):
        site_with_people.service.feed(epoch, {A: {1: LARGE, 2: SMALL}, B: {1: None}})
    assert reader.lost_gops, "some events, and perhaps a list"
    speaking = asyncio.create_task(received.run())
    lists: set[str] = set()
    try:
        async with asyncio.timeout(PATIENCE):
            async for data in reader:
                name = data.partition(b"\n")[0].removeprefix(b"event: ").decode()
                lists |= {name} & {"objects", "cameras", "site"}
                if len(lists) == 3:
                    break
    finally:
        speaking.cancel()
