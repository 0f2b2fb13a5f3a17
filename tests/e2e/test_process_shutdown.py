"""Every process exits cleanly on SIGTERM, whatever it is waiting for.

The conditions that processes wait for here never occur.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest
import yaml

from fakes.running.site import MYVIEW
from fakes.timeouts import PATIENCE
from server.camera.sources.stream_reader import OPEN_S
from server.cli.generated_config import free_port

pytestmark = [pytest.mark.live]

WAITS_S = 3600.0
"""Time for which pulse 0 and the cameras wait."""
SCENE = "scene:room?camera=0&cameras=3&objects=4&seed=1"


@contextlib.asynccontextmanager
async def silent_camera() -> AsyncIterator[tuple[str, asyncio.Event]]:
    """Run a camera that sends nothing; yield its address and the event of a connection."""
    connected = asyncio.Event()

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connected.set()
        with contextlib.suppress(ConnectionError):
            await reader.read()
        writer.close()

    server = await asyncio.start_server(accept, "127.0.0.1", 0)
    async with server:
        yield f"rtsp://127.0.0.1:{server.sockets[0].getsockname()[1]}/live", connected


def site(folder: Path, *sources: str) -> tuple[Path, dict[str, Any]]:
    """Write a configuration in which all processes wait for cameras that never connect."""
    bus = f"tcp/127.0.0.1:{free_port()}"
    content: dict[str, Any] = {
        "site": {"width": 160, "height": 90},
        "sync": {"port": free_port(), "start_timeout_s": WAITS_S},
        "zenoh": {"connect": bus, "listen": bus},
        "http": {"port": free_port()},
        "cameras": [{"id": f"c{number}", "source": source} for number, source in enumerate(sources)],
    }
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(content))
    return path, content


async def start(*arguments: str | Path, until: str) -> Process:
    """Start a process, and wait until a line of its log contains `until`."""
    process = await asyncio.create_subprocess_exec(
        *MYVIEW,
        *map(str, arguments),
        stderr=PIPE,
        stdout=DEVNULL,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert process.stderr is not None
    async for line in process.stderr:
        if until in line.decode():
            return process
    raise AssertionError(f"{arguments[0]} ended with {await process.wait()}")


async def end(*processes: Process) -> list[int]:
    """Send SIGTERM to processes; return their exit codes."""
    for process in processes:
        process.send_signal(signal.SIGTERM)
    outputs = await asyncio.gather(*(process.communicate() for process in processes))
    assert not any(b"Traceback" in log for _, log in outputs)
    return [process.returncode or 0 for process in processes]


def processes_of(config: Path) -> list[bytes]:
    """Return the commands that run with a configuration."""
    found = []
    for process in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            found.append(process.read_bytes())
    return [command for command in found if os.fsencode(config) in command]


async def read_answer(session: aiohttp.ClientSession, path: str) -> None:
    """Read an answer until it ends or is broken off."""
    with contextlib.suppress(aiohttp.ClientError):
        async with session.get(path) as answer:
            await answer.read()


async def test_waiting_processes_exit_on_sigterm(tmp_path: Path) -> None:
    config, content = site(tmp_path, SCENE, SCENE)
    async with asyncio.timeout(PATIENCE):
        sync, bestview = await asyncio.gather(
            start("sync", config, until="bestview connected"), start("bestview", config, until="pulse server")
        )
        async with aiohttp.ClientSession(f"http://127.0.0.1:{content['http']['port']}") as session:
            readers = [
                asyncio.create_task(read_answer(session, path))
                for path in ("/api/events", "/cameras/c0/live.mp4", "/cameras/c0/hls/live.m3u8?_HLS_msn=1")
            ]
            await asyncio.sleep(0)
            while "myview_pulse -1.0" not in await (await session.get("/metrics")).text():
                pass
            assert await end(sync, bestview) == [0, 0]
            await asyncio.gather(*readers)


async def test_a_camera_exits_while_it_opens_its_source(tmp_path: Path) -> None:
    async with asyncio.timeout(PATIENCE), silent_camera() as (address, connected):
        config, _ = site(tmp_path, address, SCENE)
        camera = await asyncio.create_subprocess_exec(*MYVIEW, "camera", config, "c0", stderr=PIPE)
        await connected.wait()
        async with asyncio.timeout(OPEN_S):  # the time given to a silent camera
            assert await end(camera) == [0]


@pytest.mark.slow
async def test_a_starting_site_exits_without_leaving_processes(tmp_path: Path) -> None:
    async with asyncio.timeout(PATIENCE), silent_camera() as (address, connected):
        config, _ = site(tmp_path, address, SCENE)
        up = await start("up", config, until="sync: pulses at")
        await connected.wait()
        assert len(processes_of(config)) > 1
        assert await end(up) == [0]
    assert not processes_of(config)


@pytest.mark.slow
async def test_the_demo_exits_while_it_starts(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "TMPDIR": str(tmp_path)}
    async with asyncio.timeout(PATIENCE):
        for number in (signal.SIGTERM, signal.SIGHUP):
            demo = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "server.cli.main", "demo", "--no-browser", "--port", "0"),
                stdout=PIPE,
                stderr=DEVNULL,
                env=environment,
            )
            assert demo.stdout is not None
            assert b"frames a second" in await demo.stdout.readline()
            demo.send_signal(number)
            assert await demo.wait() == 0
            assert list(tmp_path.iterdir()) == []
