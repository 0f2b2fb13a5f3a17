"""docker-compose.yml on a real engine: five containers that show people, and heal."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import pytest

import client

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(1200)]

ROOT = Path(__file__).resolve().parents[2]
SERVICES = {"sync", "bestview", "c0", "c1", "c2"}
BUILD_S = 900  # an image without any cache downloads some 250 MB
COMMAND_S = 120
SEEN_S = 180  # a background must be learned first, and people come and go
HEALED_S = 60
WATCHED_S = 12.0
FPS = 25


@dataclass(frozen=True, slots=True)
class Site:
    """One running compose project."""

    environment: dict[str, str]
    url: str = ""

    def run(self, *words: str, seconds: float = COMMAND_S, check: bool = True) -> str:
        done = subprocess.run(
            words,
            cwd=ROOT,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=seconds,
            check=False,
        )
        if check and done.returncode:
            pytest.fail(f"{' '.join(words)}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}")
        return done.stdout.strip()

    def compose(self, *words: str, seconds: float = COMMAND_S, check: bool = True) -> str:
        return self.run("docker", "compose", *words, seconds=seconds, check=check)

    def containers(self) -> dict[str, dict[str, Any]]:
        """Inspect every container, those included that have ended."""
        ids = self.compose("ps", "--all", "--quiet").split()
        found = json.loads(self.run("docker", "inspect", *ids)) if ids else []
        return {it["Config"]["Labels"]["com.docker.compose.service"]: it for it in found}


@pytest.fixture(scope="module")
def site() -> Iterator[Site]:
    """Build, start and await a whole site; nothing of it is left."""
    _need_engine()
    name = f"myview-test-{uuid.uuid4().hex[:8]}"
    down = Site(
        {
            **{key: it for key, it in os.environ.items() if not key.startswith(("MYVIEW_", "COMPOSE_"))},
            "COMPOSE_PROJECT_NAME": name,
            "MYVIEW_IMAGE": name,
            "MYVIEW_CONFIG": "demo.yaml",
            "MYVIEW_PUBLISH": "127.0.0.1:0",
            "MYVIEW_RESTART": "unless-stopped",
        }
    )
    try:
        down.compose("build", seconds=BUILD_S)
        _up(down)
        yield Site(down.environment, f"http://{down.compose('port', 'bestview', '8080')}")
    finally:
        down.compose("down", "--volumes", "--rmi", "all", "--timeout", "5")


def _need_engine() -> None:
    if shutil.which("docker") is None:
        pytest.skip("needs Docker: there is no `docker` here")
    for words in (["docker", "info"], ["docker", "compose", "version"]):
        try:
            answer = subprocess.run(words, capture_output=True, timeout=30, check=False).returncode
        except subprocess.TimeoutExpired:
            answer = 1
        if answer:
            pytest.skip(f"needs a Docker Engine with Compose: `{' '.join(words)}` fails")


def _up(site: Site) -> None:
    """Start all and wait for their health; what they said goes with a failure."""
    done = subprocess.run(
        ["docker", "compose", "up", "--detach", "--wait", "--wait-timeout", "240"],
        cwd=ROOT,
        env=site.environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    if done.returncode:
        pytest.fail(f"compose up: {done.stderr}\n{site.compose('logs', check=False)}")


async def _somebody(site: Site, camera: str | None = None) -> int:
    """Wait until a person is listed whom this camera shows (None: any camera)."""
    async with asyncio.timeout(SEEN_S):
        async for event in client.events(site.url):
            if isinstance(event, client.Objects):
                shown = [it.object for it in event.objects if it.visible and camera in {None, it.camera}]
                if shown:
                    return shown[0]
    pytest.fail("the events have ended")


async def _sees_somebody(site: Site, camera: str, after: int) -> None:
    """Wait until this camera has somebody in a frame after that pulse."""
    async with asyncio.timeout(HEALED_S):
        async for event in client.events(site.url):
            if isinstance(event, client.Gop) and event.first > after and any(event.boxes.get(camera, ())):
                return


def test_five_containers_are_healthy(site: Site) -> None:
    containers = site.containers()
    assert set(containers) == SERVICES
    assert {it["State"]["Health"]["Status"] for it in containers.values()} == {"healthy"}
    assert len({it["Image"] for it in containers.values()}) == 1, "one image serves all"


def test_no_service_runs_as_root_and_only_the_best_view_is_published(site: Site) -> None:
    containers = site.containers()
    for service in SERVICES:
        assert site.compose("exec", "-T", service, "id", "-u") not in {"", "0"}
    published = {name for name, it in containers.items() if any(it["NetworkSettings"]["Ports"].values())}
    assert published == {"bestview"}


async def test_people_are_listed_and_their_best_view_plays(site: Site, tmp_path: Path) -> None:
    number = await _somebody(site)
    out = tmp_path / "best.mp4"
    async with asyncio.timeout(60):
        watched = await client.record(site.url, number, out, seconds=4.0)
    assert watched.complete
    with av.open(str(out)) as video:
        pictures = [(frame.width, frame.height) for frame in video.decode(video=0)]
    assert pictures == [(640, 360)] * 100


async def test_viewers_watch_on_while_a_camera_is_killed_and_comes_back(site: Site, tmp_path: Path) -> None:
    number = await _somebody(site, "c1")
    before = site.containers()["c1"]
    out = tmp_path / "best.mp4"
    async with asyncio.timeout(HEALED_S):
        watching = asyncio.create_task(client.record(site.url, number, out, seconds=WATCHED_S))
        await _kill(site, "c1")
        await _started_again(site, before)
        newest = max(camera.pulse or 0 for camera in await client.cameras(site.url))
        watched = await watching
    await _sees_somebody(site, "c1", after=newest)
    assert watched.complete
    assert watched.reconnections == 0
    with av.open(str(out)) as video:
        assert sum(1 for _ in video.decode(video=0)) == WATCHED_S * FPS, "not a frame is missing"
    assert site.containers()["c1"]["RestartCount"] == before["RestartCount"] + 1
    _up(site)  # the engine finds all of them healthy again


async def _kill(site: Site, service: str) -> None:
    """Kill all in a container but its init, which ends with them.

    `docker kill` would tell the engine that the container was meant to end.
    """
    await asyncio.to_thread(site.compose, "exec", "-T", service, "sh", "-c", "kill -KILL -1", check=False)


async def _started_again(site: Site, before: dict[str, Any]) -> None:
    """Wait for the engine to start a container, counted from its last start."""
    since, container = before["State"]["StartedAt"], before["Id"]
    filters = ["--filter", f"container={container}", "--filter", "event=die", "--filter", "event=start"]
    events = await asyncio.create_subprocess_exec(
        *["docker", "events", "--since", since, *filters, "--format", "{{.Action}}"],
        env=site.environment,
        stdout=asyncio.subprocess.PIPE,
    )
    assert events.stdout is not None
    died = False
    while (line := await events.stdout.readline()) and not (died and line == b"start\n"):
        died |= line == b"die\n"
    assert line, "the engine's events have ended"
    events.terminate()
    await events.wait()
