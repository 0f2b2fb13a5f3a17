"""A site with several best-view services, each process started by itself as on several machines."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import signal
import sys
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from benchmarks.common.environment import ROOT
from benchmarks.scaling.simulated_hall import HEIGHT, WIDTH, SimulatedHall
from client import ClientError, Gop, HttpSettings, events, objects
from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port

HALL = SimulatedHall(cameras=2, per_camera=3)
FPS = 25.0


def configuration(
    folder: Path,
    services: int = 2,
    hosts: Sequence[str] = (),
    sharding: dict[str, Any] | None = None,
    **sections: Any,
) -> Path:
    """Write the configuration of a site of simulated cameras; services listen on ports of `hosts`.

    `sharding` and `sections` are merged into it, or replace its lists.
    """
    hosts = hosts or ["127.0.0.1"] * services
    routers = [f"tcp/{host}:{free_port()}" for host in hosts]
    content: dict[str, Any] = {
        "site": {"name": "hall", "fps": FPS, "width": WIDTH, "height": HEIGHT},
        "sync": {"port": free_port(), "start_timeout_s": 3.0},
        "zenoh": {"connect": routers, "listen": routers[0]},
        "track": {"joint": False},  # simulated cameras send tracks alone
        "view": {
            "sharding": {"servers": [f"http://{host}:{free_port()}/" for host in hosts], **(sharding or {})}
        },
        "cameras": [
            {"id": name, "source": f"rtsp://{name}/", "ground": ground.tolist()}
            for name, ground in zip(HALL.ids, HALL.grounds, strict=True)
        ],
    }
    for name, value in sections.items():
        content[name] = {**content.get(name, {}), **value} if isinstance(value, dict) else value
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


@dataclass(slots=True)
class Process:
    """A process of the site, and its log."""

    process: asyncio.subprocess.Process
    reading: asyncio.Task[None]

    def send(self, number: signal.Signals) -> None:
        if self.process.returncode is None:
            self.process.send_signal(number)


@dataclass(slots=True)
class SeveralServices:
    """The processes by name (sync, bestview-0, bestview-1; cameras, which simulates all, or camera-c0 …), and
    their log."""

    config: Path
    content: dict[str, Any]
    prefixes: dict[str, list[str]] = field(default_factory=dict)
    """Words before a process's command, by name; such as those that run it in another network namespace."""
    running: dict[str, Process] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    @property
    def urls(self) -> list[str]:
        return list(self.content["view"]["sharding"]["servers"])

    async def start(self, name: str) -> None:
        """Start a process."""
        words = ["server.cli.main", name, str(self.config)]
        environment = {**os.environ, "MYVIEW_SUPERVISED": "1", "OMP_NUM_THREADS": "1"}
        if name == "cameras":
            count = [str(HALL.per_camera), "0", str(HALL.cameras)]
            words = ["benchmarks.scaling.simulated_cameras", str(self.config), *count]
        elif name.startswith("camera-"):
            words = ["server.cli.main", "camera", str(self.config), name.removeprefix("camera-")]
        elif match := re.fullmatch(r"bestview-(\d+)", name):
            index = int(match[1])
            address, port = self.urls[index].strip("/").rpartition("/")[2].split(":")
            words[1] = "bestview"
            environment |= {
                "MYVIEW_VIEW__SHARDING__INDEX": match[1],
                "MYVIEW_ZENOH__LISTEN": self.content["zenoh"]["connect"][index],
                "MYVIEW_HTTP__HOST": address,
                "MYVIEW_HTTP__PORT": port,
            }
        process = await asyncio.create_subprocess_exec(
            *self.prefixes.get(name, []),
            *(sys.executable, "-m", *words),
            cwd=ROOT,
            stderr=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.DEVNULL,
            env=environment,
        )
        self.running[name] = Process(process, asyncio.create_task(self._read(name, process)))

    async def _read(self, name: str, process: asyncio.subprocess.Process) -> None:
        assert process.stderr is not None
        async for line in process.stderr:
            self.lines.append(f"{name}: {line.decode().rstrip()}")

    async def kill(self, name: str) -> None:
        """Kill a process (SIGKILL)."""
        self.running[name].send(signal.SIGKILL)
        await self.running[name].process.wait()

    async def stop(self) -> None:
        """Terminate all processes."""
        for process in self.running.values():
            process.send(signal.SIGCONT)
            process.send(signal.SIGTERM)
        for process in self.running.values():
            try:
                await asyncio.wait_for(process.process.wait(), 20.0)
            except TimeoutError:
                process.send(signal.SIGKILL)
                await process.process.wait()
            process.reading.cancel()
            await asyncio.gather(process.reading, return_exceptions=True)

    async def numbers(self, index: int, people: int = 1) -> list[int]:
        """Return who is visible to a service, once there are so many people."""
        async with asyncio.timeout(PATIENCE):
            while True:
                with contextlib.suppress(ClientError):
                    visible = [person.object for person in await objects(self.urls[index]) if person.visible]
                    if len(visible) >= people:
                        return visible
                await asyncio.sleep(0.05)


class Watcher:
    """The GOPs that one service decides, with the times at which they came, until cancelled."""

    def __init__(self, url: str) -> None:
        self.gops: list[tuple[float, Gop]] = []
        self._url = url
        self._received = asyncio.Condition()

    async def run(self) -> None:
        async for event in events(self._url, HttpSettings(stream_retries=int(PATIENCE))):
            if isinstance(event, Gop):
                async with self._received:
                    self.gops.append((time.monotonic(), event))
                    self._received.notify_all()

    async def until(self, pulse: int) -> None:
        """Wait for the GOP that ends at this pulse or later."""
        async with asyncio.timeout(PATIENCE), self._received:
            await self._received.wait_for(lambda: bool(self.gops) and self.last_pulse >= pulse)

    @property
    def last_pulse(self) -> int:
        return self.gops[-1][1].first + self.gops[-1][1].frames - 1

    def longest_wait(self, since: float) -> float:
        """Return the longest time between two GOPs since a moment of the monotonic clock."""
        times = [at for at, _ in self.gops]
        return max((b - a for a, b in pairwise(times) if b >= since), default=0.0)

    def has_every_pulse(self) -> bool:
        """Return whether no GOP is missing between the first and the last."""
        gops = [gop for _, gop in self.gops]
        return all(a.first + a.frames == b.first for a, b in pairwise(gops))


@contextlib.asynccontextmanager
async def watching(url: str) -> AsyncIterator[Watcher]:
    """Follow a service's decisions."""
    watcher = Watcher(url)
    task = asyncio.create_task(watcher.run())
    try:
        yield watcher
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@contextlib.asynccontextmanager
async def several_services(
    config: Path, prefixes: dict[str, list[str]] | None = None, cameras: Sequence[str] = ("cameras",)
) -> AsyncIterator[SeveralServices]:
    """Run a site's services, pulse server and cameras, and terminate them at the end."""
    content = yaml.safe_load(config.read_text(encoding="utf-8"))
    site = SeveralServices(config, content, prefixes or {})
    try:
        for index in range(len(site.urls)):
            await site.start(f"bestview-{index}")
        for name in ("sync", *cameras):
            await site.start(name)
        yield site
    finally:
        await site.stop()
