"""docker-compose.yml on a real engine: five containers that show people, keep their limits, and recover."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import pytest
import yaml

import client
from benchmarks.faults.site.compose_site import PLAIN, ComposeSite, missing_requirement, run_compose_site

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(1200)]

SERVICES = {"sync", "bestview", "c0", "c1", "c2"}
VISIBLE_S = 180  # the background must be learned first, and people come and go
RECOVERY_S = 150  # five processes share the processors
WATCHED_S = 12.0
FPS = 12.5  # two processors run the demo at half its rate


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ComposeSite]:
    """Build and start a site; remove it at the end."""
    missing = missing_requirement()
    if missing is not None:
        pytest.skip(missing)
    slower = tmp_path_factory.mktemp("compose") / "slower.yml"
    environment = {"environment": {"MYVIEW_SITE__FPS": str(FPS)}}
    slower.write_text(yaml.safe_dump({"services": dict.fromkeys(sorted(SERVICES), environment)}))
    with run_compose_site((*PLAIN, slower), MYVIEW_CONFIG="demo.yaml") as running:
        yield running


def url_of(site: ComposeSite) -> str:
    return f"http://{site.address()}"


async def _visible_person(site: ComposeSite, camera: str | None = None) -> int:
    """Wait until a camera (None: any) shows a person; return their id."""
    async with asyncio.timeout(VISIBLE_S):
        async for event in client.events(url_of(site)):
            if isinstance(event, client.Objects):
                shown = [
                    shown_object.object
                    for shown_object in event.objects
                    if shown_object.visible and camera in {None, shown_object.camera}
                ]
                if shown:
                    return shown[0]
    pytest.fail("the events have ended")


async def _wait_for_detection(site: ComposeSite, camera: str, after: int) -> None:
    """Wait until a camera has a box in a frame after a pulse."""
    async with asyncio.timeout(RECOVERY_S):
        async for event in client.events(url_of(site)):
            if isinstance(event, client.Gop) and event.first > after and any(event.boxes.get(camera, ())):
                return


def test_five_containers_are_healthy(site: ComposeSite) -> None:
    containers = site.containers()
    assert set(containers) == SERVICES
    assert {container["State"]["Health"]["Status"] for container in containers.values()} == {"healthy"}
    assert len({container["Image"] for container in containers.values()}) == 1, "one image serves all"


def test_no_service_runs_as_root_and_only_the_best_view_is_published(site: ComposeSite) -> None:
    containers = site.containers()
    for service in SERVICES:
        assert site.compose("exec", "-T", service, "id", "-u") not in {"", "0"}
    published = {
        name for name, container in containers.items() if any(container["NetworkSettings"]["Ports"].values())
    }
    assert published == {"bestview"}


def test_limits_hold(site: ComposeSite) -> None:
    """A process that exceeds its container's memory is killed; the others continue."""
    for name, container in site.containers().items():
        host = container["HostConfig"]
        assert 0 < host["Memory"] == host["MemorySwap"], name
        assert host["NanoCpus"] > 0, name
        assert 0 < host["PidsLimit"] <= 512, name
        assert host["ReadonlyRootfs"], name
        assert not host["Privileged"], name
        assert host["CapDrop"] == ["ALL"], name
    allocate = "held = bytearray(400 << 20); held[::4096] = b'x' * (len(held) // 4096); print('held')"
    assert site.compose("exec", "-T", "c1", "python", "-c", allocate) == "held"
    before = site.state("sync")["StartedAt"]
    assert "held" not in site.compose("exec", "-T", "sync", "python", "-c", allocate, check=False)
    forks = "i=0; while [ $i -lt 200 ]; do sleep 20 & i=$((i+1)); done; echo all"
    assert "all" not in site.compose("exec", "-T", "sync", "sh", "-c", forks, check=False)
    assert site.state("sync")["StartedAt"] == before, "the pulse server survives"
    for path in ("/site/x", "/usr/x", "/site/configs/x"):
        assert (
            site.compose("exec", "-T", "c1", "sh", "-c", f"touch {path} || echo refused", check=False)
            == "refused"
        )


async def test_people_are_listed_and_their_best_view_plays(site: ComposeSite, tmp_path: Path) -> None:
    number = await _visible_person(site)
    out = tmp_path / "best.mp4"
    async with asyncio.timeout(60):
        watched = await client.record(url_of(site), number, out, seconds=4.0)
    assert watched.complete
    with av.open(str(out)) as video:
        pictures = [(frame.width, frame.height) for frame in video.decode(video=0)]
    assert pictures == [(640, 360)] * round(4.0 * FPS)


async def test_streams_continue_while_a_camera_is_killed_and_restarted(
    site: ComposeSite, tmp_path: Path
) -> None:
    number = await _visible_person(site, "c1")
    before = site.containers()["c1"]
    out = tmp_path / "best.mp4"
    async with asyncio.timeout(RECOVERY_S):
        watching = asyncio.create_task(client.record(url_of(site), number, out, seconds=WATCHED_S))
        await _kill(site, "c1")
        await _wait_for_restart(site, before)
        newest = max(camera.pulse or 0 for camera in await client.cameras(url_of(site)))
        watched = await watching
    await _wait_for_detection(site, "c1", after=newest)
    assert watched.complete
    assert watched.reconnections == 0
    with av.open(str(out)) as video:
        assert sum(1 for _ in video.decode(video=0)) == WATCHED_S * FPS, "no frame is missing"
    assert site.containers()["c1"]["RestartCount"] == before["RestartCount"] + 1
    site.up()  # all are healthy again


async def _kill(site: ComposeSite, service: str) -> None:
    """Kill all processes of a container but init, which exits with them.

    After `docker kill` the engine would not restart the container.
    """
    await asyncio.to_thread(site.compose, "exec", "-T", service, "sh", "-c", "kill -KILL -1", check=False)


async def _wait_for_restart(site: ComposeSite, before: dict[str, Any]) -> None:
    """Wait until the engine has restarted a container."""
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
