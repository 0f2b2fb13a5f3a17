"""After a restart of the best view, people that cameras kept tracking have the same ids."""

from __future__ import annotations

import asyncio
import os
import signal
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import aiohttp
import msgspec
import pytest
import yaml

from client import Gop
from fakes.running.site import RunningSite, running, with_timeout
from fakes.timeouts import PATIENCE
from server.cli.generated_config import DEMO, free_port
from server.config.sections import ZenohSettings
from server.messaging.bus import Bus
from server.messaging.inbox import Message
from server.messaging.messages import CameraTracks, ZenohKeys
from server.service.identity.local_numbers import TrackName

pytestmark = [
    pytest.mark.live,
    pytest.mark.slow,  # tracks are kept for 30 s, in which a busy machine cannot restart the service
    pytest.mark.asyncio,
]


def ids_by_track(gops: Sequence[Gop], messages: Sequence[CameraTracks]) -> dict[TrackName, set[int]]:
    """Return the ids with which each track's boxes were published."""
    numbers = {
        (camera, gop.first + at, (box.left, box.top, box.right, box.bottom)): box.object
        for gop in gops
        for camera, frames in gop.boxes.items()
        for at, row in enumerate(frames)
        for box in row
    }
    found: dict[TrackName, set[int]] = defaultdict(set)
    for message in messages:
        for track in message.tracks:
            for at, place in enumerate(track.boxes):
                number = (
                    None if place is None else numbers.get((message.camera, message.first + at, tuple(place)))
                )
                if number is not None:
                    found[TrackName(message.camera, message.boot, track.id)].add(number)
    return found


async def test_a_restarted_best_view_shows_the_same_people_under_the_same_addresses(
    tmp_path: Path,
) -> None:
    address = f"tcp/127.0.0.1:{free_port()}"
    content = {
        **DEMO,
        "cameras": DEMO["cameras"][:2],
        "site": {"name": "e2e", "fps": 10, "width": 320, "height": 180},
        "sync": {"port": free_port(), "start_timeout_s": 60},
        "zenoh": {"connect": address, "listen": address},
        "http": {"port": free_port()},
    }
    config = tmp_path / "site.yaml"
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    async with running(config) as site:
        await site.until(lambda: bool(site.gops and site.gops[-1].choices), "a person is shown")
        messages: list[CameraTracks] = []
        bus = await asyncio.to_thread(
            Bus.peer_listener, ZenohSettings(connect=site.config["zenoh"]["connect"])
        )
        try:
            bus.subscribe(
                ZenohKeys("e2e").camera("*", "tracks"), lambda message: messages.append(read(message))
            )
            for _ in range(2):
                await kill_and_check(site, messages)
        finally:
            bus.close()


def read(message: Message) -> CameraTracks:
    return msgspec.msgpack.decode(message.payload, type=CameraTracks)


async def kill_and_check(site: RunningSite, messages: list[CameraTracks]) -> None:
    since = site.pulse
    await site.until(
        lambda: site.pulse > since + 50 and len(ids_in_last_frame(site.gops[-1])) > 1, "people are tracked"
    )
    numbers = ids_in_last_frame(site.gops[-1])
    count, before = len(site.gops), site.children()["bestview"]
    os.kill(before, signal.SIGKILL)
    died = site.pulse
    async with asyncio.timeout(PATIENCE), aiohttp.ClientSession() as session:
        # People may have left in the meantime.
        while 200 not in (answers := [await request_status(session, site.url, number) for number in numbers]):
            lines = "\n".join(site.lines)
            assert set(answers) <= {None, 503}, f"an id that may return is unknown: {numbers}\n{lines}"
            await asyncio.sleep(0.05)
    before_ids = ids_by_track(site.gops[:count], messages)

    def surviving_tracks() -> dict[TrackName, set[int]]:
        """Return the ids of the tracks that continued without the service."""
        on = {track for message in messages if message.last > died for track in tracks_of(message)}
        now = ids_by_track(site.gops[count:], messages)
        return {track: now[track] for track in before_ids.keys() & now.keys() & on}

    def resumed() -> bool:
        return site.pulse > died + 50 and len(site.gops) > count + 3 and len(surviving_tracks()) > 1

    await with_timeout(site.until(resumed, "the site and tracks continue"))
    assert site.children()["bestview"] != before
    for track, numbers_now in surviving_tracks().items():
        assert numbers_now & before_ids[track], f"{track}: {before_ids[track]} {numbers_now}"
    now = ids_by_track(site.gops[count:], messages)
    used = {number for numbers in before_ids.values() for number in numbers}
    new = {number for track, numbers in now.items() if track not in before_ids for number in numbers} - used
    assert all(number > max(used) for number in new), "ids are not reused"


def ids_in_last_frame(gop: Gop) -> set[int]:
    """Return the ids with a box in the last frame."""
    return {box.object for frames in gop.boxes.values() for box in frames[-1]}


def tracks_of(message: CameraTracks) -> list[TrackName]:
    return [TrackName(message.camera, message.boot, track.id) for track in message.tracks]


async def request_status(session: aiohttp.ClientSession, url: str, number: int) -> int | None:
    """Request a person's best view; return the status, or None without an answer."""
    try:
        async with session.get(f"{url}objects/{number}/best.mp4") as answer:
            return answer.status
    except aiohttp.ClientError:
        return None
