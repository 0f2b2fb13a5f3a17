"""A token for one person or one camera reveals nothing of others."""

from __future__ import annotations

import json
import logging
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from fakes.http.tokens import bearer, serve_with_tokens, token_of
from fakes.service.fed_site import A, B, ServedSite, show_people
from fakes.service.scripted_cameras import LARGE, SMALL, camera_tracks, tracks
from server.messaging.operator_messages import RiskEvent


@pytest.fixture
async def site(tmp_path: Path) -> AsyncIterator[ServedSite]:
    async with serve_with_tokens(tmp_path) as served:
        show_people(served)
        yield served


async def get(served: ServedSite, path: str, token_name: str) -> Any:
    async with served.session.get(path, headers=bearer(token_name)) as answer:
        assert answer.status == 200
        text = await answer.text()
        return (
            [json.loads(line) for line in text.splitlines()]
            if "ndjson" in answer.content_type
            else json.loads(text)
        )


async def events(answer: aiohttp.ClientResponse, last: int) -> list[tuple[str, Any]]:
    """Read events up to the GOP that begins at a pulse."""
    received: list[tuple[str, Any]] = []
    name = ""
    while not received or received[-1][0] != "gop" or received[-1][1]["first"] < last:
        line = (await answer.content.readline()).decode().rstrip("\n")
        if line.startswith("event: "):
            name = line.removeprefix("event: ")
        elif line.startswith("data: "):
            received.append((name, json.loads(line.removeprefix("data: "))))
    return received


def people_in(gop: dict[str, Any]) -> set[int]:
    """Return the numbers of all people in a GOP event."""
    boxes = {box[0] for frames in gop["boxes"].values() for frame in frames for box in frame}
    received = {change[key] for change in gop["merged"] + gop["split"] for key in ("kept",)}
    return (
        boxes | {int(number) for number in gop["choices"]} | {cut["object"] for cut in gop["cuts"]} | received
    )


async def test_only_the_scoped_person_is_listed(site: ServedSite) -> None:
    assert [person["object"] for person in (await get(site, "/api/objects", "desk"))["objects"]] == [1, 2]
    assert [person["object"] for person in (await get(site, "/api/objects", "family"))["objects"]] == [1]
    assert (await get(site, "/api/objects", "door"))["objects"] == []


async def test_only_the_scoped_camera_is_listed_without_others_errors(site: ServedSite) -> None:
    site.service.ingest.states[B].refused = "its parameters are not those of camera c0"
    unscoped = (await get(site, "/api/cameras", "desk"))["cameras"]
    assert [camera["camera"] for camera in unscoped] == [A, B]
    assert "its parameters" in repr(unscoped)
    assert [camera["camera"] for camera in (await get(site, "/api/cameras", "door"))["cameras"]] == [A]
    response = (await get(site, "/api/cameras", "family"))["cameras"]
    assert [camera["camera"] for camera in response] == [A, B]
    assert "its parameters" not in repr(response)
    assert (await get(site, "/api/site", "door"))["cameras"] == [A]
    assert (await get(site, "/api/site", "family"))["cameras"] == [A, B]


async def test_events_are_limited_to_the_scoped_person(site: ServedSite) -> None:
    async with (
        site.session.get("/api/events", headers=bearer("family")) as response,
        site.session.get("/api/events", headers=bearer("desk")) as unscoped_response,
    ):
        site.service.feed(3, {A: {1: LARGE, 2: SMALL}, B: {1: None}})
        last = site.service.decision_state.end - 5
        received = await events(response, last)
        assert [name for name, _ in received[:3]] == ["site", "objects", "cameras"]
        gops = [content for name, content in received if name == "gop"]
        assert len(gops) > 2
        assert {number for gop in gops for number in people_in(gop)} == {1}
        unscoped = [content for name, content in await events(unscoped_response, last) if name == "gop"]
        assert {number for gop in unscoped for number in people_in(gop)} == {1, 2}
        assert [gop["first"] for gop in gops] == [gop["first"] for gop in unscoped]
        assert [gop["choices"]["1"] for gop in gops] == [gop["choices"]["1"] for gop in unscoped]


async def test_events_are_limited_to_the_scoped_camera(site: ServedSite) -> None:
    async with site.session.get("/api/events", headers=bearer("door")) as answer:
        gops = [content for name, content in await events(answer, 0) if name == "gop"]
    assert all(set(gop["boxes"]) == {A} for gop in gops)
    assert not any(gop["choices"] or gop["cuts"] for gop in gops)


async def test_flags_are_limited_to_the_scope(site: ServedSite, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "server.service.operator_assist.flag_budget._COOLDOWN_S", -1.0
    )  # both people are flagged, although they share an event
    risk_events = [
        RiskEvent(reason="crossing", tracks=[1, 2], pulse=19, margin=0.5, risk=0.5),
        RiskEvent(reason="track_loss", tracks=[2], pulse=19, margin=0.5, risk=0.5),
    ]
    track_message = camera_tracks(A, 3, {1: SMALL, 2: SMALL}, risk_events=risk_events)
    async with site.session.get("/api/events", headers=bearer("family")) as response:
        site.service.ingest.receive_tracks(tracks(track_message))
        site.service.ingest.receive_tracks(tracks(camera_tracks(B, 3, {1: LARGE})))
        site.service.decide()
        unscoped = (await get(site, "/api/flags", "desk"))["flags"]
        assert [(flag["objects"], flag["cameras"], flag["state"]) for flag in unscoped] == [
            ([1, 2], [A], "raised"),
            ([2], [A], "raised"),
        ]
        flag = {**unscoped[0], "objects": [1]}
        assert (await get(site, "/api/flags", "family"))["flags"] == [flag]
        site.service.feed(4, {A: {1: LARGE, 2: SMALL}, B: {1: None}})
        received = await events(response, site.service.decision_state.end - 5)
        assert [content for name, content in received if name == "flag"] == [flag]
    assert len((await get(site, "/api/flags", "door"))["flags"]) == 2
    async with site.session.get("/api/events", headers=bearer("family")) as later:
        names = [name for name, _ in await events(later, 0)]
        assert names.index("flag") < names.index("gop"), "a new subscriber receives the open flags"


async def test_recorded_decisions_are_limited_to_the_scoped_person(site: ServedSite) -> None:
    unscoped = await get(site, "/api/past?from=p0", "desk")
    response = await get(site, "/api/past?from=p0", "family")
    assert {number for gop in unscoped for number in people_in({"merged": [], "split": [], **gop})} == {
        1,
        2,
    }
    assert {number for gop in response for number in people_in({"merged": [], "split": [], **gop})} == {1}
    assert [gop["first"] for gop in response] == [gop["first"] for gop in unscoped]


async def test_the_last_subscriber_of_a_scope_leaves_no_state(site: ServedSite) -> None:
    for token_name in ("family", "door", "desk"):
        async with site.session.get("/api/events", headers=bearer(token_name)) as answer:
            await events(answer, 0)


async def test_playlist_uris_have_the_token_of_the_request(site: ServedSite) -> None:
    for epoch in range(3, 12):
        site.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})
    token = token_of("family")
    for query in ({}, {"from": "p0", "to": "live"}):
        async with site.session.get("/objects/1/hls/index.m3u8", params={**query, "token": token}) as answer:
            assert answer.status == 200, await answer.text()
            text = await answer.text()
        lines = [line for line in text.splitlines() if line and (not line.startswith("#") or "URI=" in line)]
        assert len(lines) > 1
        assert all("token=token-of-family" in line for line in lines)
        address = next(line for line in lines if not line.startswith("#"))
        async with site.session.get(f"/objects/1/hls/{address}") as answer:
            assert answer.status == 200
            assert "public" not in answer.headers["Cache-Control"]
    async with site.session.get("/objects/1/hls/index.m3u8", headers=bearer("family")) as answer:
        assert "token=" not in await answer.text()


async def test_no_token_is_logged(site: ServedSite, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    for token in (token_of("desk"), "a wrong one, as long as a right one"):
        for path in ("/api/objects", "/objects/1/best.mp4", "/api/nothing", "/objects/99/best.mp4"):
            async with site.session.get(path, params={"token": token}) as answer:
                assert token not in str(answer.headers)
                if answer.status >= 400:
                    assert token not in await answer.text()
    site.service.frame_buffers = {}  # internal errors are logged, too
    async with site.session.get("/api/cameras", params={"token": token_of("lead")}) as answer:
        assert answer.status == 500
    log = [
        record.getMessage() + (record.exc_text or "")
        for record in caplog.records
        if record.name.startswith(("server", "aiohttp.server"))
    ]
    assert log
    assert not any("token-of" in line or "wrong one" in line for line in log)
