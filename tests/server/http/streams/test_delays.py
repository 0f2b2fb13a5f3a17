"""A choice of delay for viewers: streams, events, and what each costs."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import aiohttp
import av
import pytest

from fakes.http.tokens import bearer, serve_with_tokens
from fakes.service.fed_site import A, B, ServedSite, serve_site, show_people
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    LARGE,
    SMALL,
    encoded,
    joined_fragments,
    video,
)
from server.service.view_selection.delay_modes import DelayMode

SEEN = {A: {1: LARGE}, B: {1: SMALL}}


def pulses_of(data: bytes) -> list[int]:
    """Return the pulses of the complete frames of a stream."""
    with av.open(io.BytesIO(data[: last_fragment_end(data)]), "r") as stream:
        return [round(float(picture.time or 0) * FPS) for picture in stream.decode(video=0)]


def last_fragment_end(data: bytes) -> int:
    at = end = 0
    while at + 8 <= len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        if at + size > len(data):
            break
        at += size
        end = at
    return end


async def read_to(answer: aiohttp.ClientResponse, wanted: bytes) -> bytes:
    data = b""
    while wanted not in data:
        data += await answer.content.readany()
    return data


@pytest.mark.parametrize(("delay", "newest"), [("live", 5 * GOP - 1), ("balanced", 4 * GOP - 1)])
async def test_a_stream_is_as_late_as_its_delay_and_has_no_gap(
    site_with_people: ServedSite, delay: str, newest: int
) -> None:
    service = site_with_people.service
    async with site_with_people.session.get(f"/objects/1/best.mp4?delay={delay}") as answer:
        assert answer.status == 200
        for epoch in (3, 4):
            service.feed(epoch, SEEN)
        camera = B if delay == "live" else A  # in which they are large since epoch 3
        data = await read_to(answer, joined_fragments(service.frame_buffers[camera], newest, 1))
    pulses = pulses_of(data)
    assert pulses == list(range(pulses[0], newest + 1))


async def test_a_live_stream_shows_its_cameras_pictures_as_they_arrive(
    site_with_people: ServedSite,
) -> None:
    service = site_with_people.service
    choices: list[tuple[int, str | None]] = []
    service.mode_publisher.on_decision.append(
        lambda mode, decided: (
            choices.append((decided.first, decided.choices.get(1))) if mode is DelayMode.LIVE else None
        )
    )
    async with site_with_people.session.get("/objects/1/best.mp4?delay=live") as answer:
        for epoch in range(3, 7):
            service.feed(epoch, SEEN)
        last = 7 * GOP - 1
        shown = dict(choices)
        camera = shown[6 * GOP]
        assert camera == A, "by then the better camera is known"
        data = await read_to(answer, joined_fragments(service.frame_buffers[A], last, 1))
    for first, name in shown.items():
        if name is not None and first + GOP - 1 <= last:
            assert joined_fragments(service.frame_buffers[name], first, GOP) in data
    assert pulses_of(data)[-1] == last


async def test_pictures_wait_for_a_late_decision_and_none_is_lost(site_with_people: ServedSite) -> None:
    service = site_with_people.service
    async with site_with_people.session.get("/objects/1/best.mp4?delay=live") as answer:
        for seed, camera in enumerate(CAMERAS):  # two more GOPs of pictures, whose decisions are late
            for unit in encoded(seed)[3 * GOP : 6 * GOP]:
                service.ingest.receive_video(video(camera, unit))
        service.feed(3, SEEN)
        service.feed(4, SEEN)
        data = await read_to(answer, b"moof")
        while not (pulses := pulses_of(data)) or pulses[-1] < 6 * GOP - 1:
            data += await answer.content.readany()
    assert pulses == list(range(pulses[0], 6 * GOP))


async def test_smooth_has_hls_with_its_own_segments() -> None:
    async for served in serve_site(view={"smooth_lookahead_s": 3 * GOP / FPS}, http={"hls_segment_s": 0.2}):
        show_people(served)
        for epoch in range(3, 8):
            served.service.feed(epoch, SEEN)
        async with served.session.get("/objects/1/hls/index.m3u8?delay=smooth") as answer:
            assert answer.status == 200
            playlist = await answer.text()
        segments = [line for line in playlist.splitlines() if line and not line.startswith("#")]
        assert segments
        assert all(line.endswith("?delay=smooth") for line in segments)
        async with served.session.get(f"/objects/1/hls/{segments[-1]}") as answer:
            assert answer.status == 200
            assert b"moof" in await answer.read()


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/objects/1/best.mp4?delay=live", 200),
        ("/objects/1/best.ts?delay=smooth", 200),
        ("/objects/1/best.mp4?delay=fast", 400),
        ("/objects/1/best.mp4?delay=live&prefer=c0", 400),
        ("/objects/1/best.mp4?delay=smooth&from=-1", 400),
        ("/objects/1/best.mp4?delay=live&overlay=1", 400),
        ("/objects/1/hls/index.m3u8?delay=live", 400),
        ("/cameras/c0/live.mp4?delay=live", 400),
        ("/objects/9/best.mp4?delay=live", 404),
        ("/api/events?delay=fast", 400),
        ("/api/events?delay=smooth", 200),
    ],
)
async def test_a_delay_is_checked(site_with_people: ServedSite, path: str, status: int) -> None:
    async with site_with_people.session.get(path) as answer:
        assert answer.status == status
        if status == 400:
            assert "delay" in (await answer.json())["error"]


async def test_every_delay_is_listed_with_what_it_costs(site_with_people: ServedSite) -> None:
    listed = (await site_with_people.get_json("/api/delays"))["delays"]
    assert [delay["delay"] for delay in listed] == ["live", "balanced", "smooth"]
    live, balanced, smooth = (delay["lookahead_s"] for delay in listed)
    assert (live, balanced) == (0.0, 2 * GOP / FPS)
    assert smooth == pytest.approx(3.0)
    assert {"delay_s", "delay_p95_s", "regret_s", "cuts_per_minute"} <= listed[0].keys()


async def test_live_events_are_about_frames_to_come(site_with_people: ServedSite) -> None:
    service = site_with_people.service
    async with site_with_people.session.get("/api/events?delay=live") as answer:
        service.feed(3, SEEN)
        gops: list[dict[str, Any]] = []
        name = ""
        while not gops or gops[-1]["first"] <= 4 * GOP:
            line = (await answer.content.readline()).decode()
            if line.startswith("event: "):
                name = line.removeprefix("event: ").strip()
            elif line.startswith("data: ") and name == "gop":
                gops.append(json.loads(line.removeprefix("data: ")))
    assert gops[-1]["first"] > service.decision_state.end
    assert gops[-1]["choices"]["1"] in {A, B}
    assert gops[-1]["boxes"] == {}


async def test_a_token_for_one_person_has_no_live_view(tmp_path: Path) -> None:
    async with serve_with_tokens(tmp_path) as served:
        show_people(served)
        headers = bearer("family")
        async with served.session.get("/api/delays", headers=headers) as answer:
            names = [delay["delay"] for delay in (await answer.json())["delays"]]
        assert names == ["balanced", "smooth"]
        async with served.session.get("/objects/1/best.mp4?delay=live", headers=headers) as answer:
            assert answer.status == 403
            assert "person left" in (await answer.json())["error"]
        async with served.session.get("/api/events?delay=live", headers=headers) as answer:
            assert answer.status == 403
