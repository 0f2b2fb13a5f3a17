"""The best view is killed and begins anew: whoever a camera goes on following is who they were."""

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
from fakes.running.site import RunningSite, bounded, running
from fakes.timeouts import PATIENCE
from server.cli.generated_config import DEMO, free_port
from server.config.sections import ZenohSettings
from server.messaging.bus import Bus
from server.messaging.inbox import Message
from server.messaging.messages import CameraTracks, ZenohKeys
from server.service.identity.local_numbers import TrackName

pytestmark = [
    pytest.mark.live,
    pytest.mark.slow,  # tracks are kept for 30 s without a service; a busy machine starts none in that time
    pytest.mark.asyncio,
]


def whose(gops: Sequence[Gop], words: Sequence[CameraTracks]) -> dict[TrackName, set[int]]:
    """Return the numbers under which each track's boxes were shown."""
    numbers = {
        (camera, gop.first + at, (box.left, box.top, box.right, box.bottom)): box.object
        for gop in gops
        for camera, frames in gop.boxes.items()
        for at, row in enumerate(frames)
        for box in row
    }
    found: dict[TrackName, set[int]] = defaultdict(set)
    for word in words:
        for track in word.tracks:
            for at, place in enumerate(track.boxes):
                number = None if place is None else numbers.get((word.camera, word.first + at, tuple(place)))
                if number is not None:
                    found[TrackName(word.camera, word.boot, track.id)].add(number)
    return found


async def test_a_best_view_that_is_killed_shows_the_same_people_under_the_same_addresses(
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
        await site.until(lambda: bool(site.gops and site.gops[-1].choices), "somebody is shown")
        words: list[CameraTracks] = []
        bus = await asyncio.to_thread(Bus.listener, ZenohSettings(connect=site.config["zenoh"]["connect"]))
        try:
            bus.subscribe(ZenohKeys("e2e").camera("*", "tracks"), lambda message: words.append(read(message)))
            for _ in range(2):
                await killed(site, words)
        finally:
            bus.close()


def read(message: Message) -> CameraTracks:
    return msgspec.json.decode(message.payload, type=CameraTracks)


async def killed(site: RunningSite, words: list[CameraTracks]) -> None:
    since = site.pulse
    await site.until(
        lambda: site.pulse > since + 50 and len(seen_now(site.gops[-1])) > 1, "people are followed"
    )
    numbers = seen_now(site.gops[-1])
    count, before = len(site.gops), site.children()["bestview"]
    os.kill(before, signal.SIGKILL)
    died = site.pulse
    async with asyncio.timeout(PATIENCE), aiohttp.ClientSession() as session:
        # Somebody may have left meanwhile.
        while 200 not in (answers := [await asked(session, site.url, number) for number in numbers]):
            lines = "\n".join(site.lines)
            assert set(answers) <= {None, 503}, f"who may come again is said to be nobody: {numbers}\n{lines}"
            await asyncio.sleep(0.05)
    told = whose(site.gops[:count], words)

    def again() -> dict[TrackName, set[int]]:
        """Return the tracks that went on over the time without a service, as they are told now."""
        on = {track for word in words if word.last > died for track in tracks_of(word)}
        now = whose(site.gops[count:], words)
        return {track: now[track] for track in told.keys() & now.keys() & on}

    def goes_on() -> bool:
        return site.pulse > died + 50 and len(site.gops) > count + 3 and len(again()) > 1

    await bounded(site.until(goes_on, "it goes on, and so do tracks"))
    assert site.children()["bestview"] != before
    for track, numbers_now in again().items():
        assert numbers_now & told[track], f"{track}: {told[track]} {numbers_now}"
    now = whose(site.gops[count:], words)
    used = {number for numbers in told.values() for number in numbers}
    new = {number for track, numbers in now.items() if track not in told for number in numbers} - used
    assert all(number > max(used) for number in new), "numbers are not used twice"


def seen_now(gop: Gop) -> set[int]:
    """Return who has a box in the last frame."""
    return {box.object for frames in gop.boxes.values() for box in frames[-1]}


def tracks_of(word: CameraTracks) -> list[TrackName]:
    return [TrackName(word.camera, word.boot, track.id) for track in word.tracks]


async def asked(session: aiohttp.ClientSession, url: str, number: int) -> int | None:
    """Return the status of an answer about somebody's best view; None: there was none."""
    try:
        async with session.get(f"{url}objects/{number}/best.mp4") as answer:
            return answer.status
    except aiohttp.ClientError:
        return None
