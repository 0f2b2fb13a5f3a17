"""A running site: `myview up` with real processes on free ports."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import signal
import sys
from collections import defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from client import Cameras, Gop, HttpSettings, Objects, events
from fakes.running.stream_frames import FPS
from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port

PATIENT_CAMERAS = {"backlog_s": 60}
"""Settings of sites that skip no frame, however busy the machine is."""
MYVIEW = [sys.executable, "-m", "server.cli.main"]
CAMERAS = ("c0", "c1", "c2")


def configuration(folder: Path, recording: Path, *, detects: bool = False, **sections: Any) -> Path:
    """Write the configuration of a site of three recorded views; ``sections`` are merged into it.

    The boxes are given unless it ``detects``: two thirds of a camera's processor time.
    """
    bus = f"tcp/127.0.0.1:{free_port()}"
    content: dict[str, Any] = {
        # Cameras get almost normal priority, so that they are not starved on a busy machine.
        "site": {"name": "e2e", "fps": FPS, "width": 320, "height": 180, "niceness": 1},
        "sync": {"port": free_port(), "start_timeout_s": 60},
        "zenoh": {"connect": bus, "listen": bus},
        "http": {"port": free_port()},
        "track": PATIENT_CAMERAS,
        # Half of the processor time.
        "detect": {
            "work_width": 192,
            "box_filter": {"height_step": 1.16},
            "foreground_fit": {"max_hypotheses": 8},
        },
        "view": {"switch_cost_s": 0.1, "late_after_s": 10},  # enough cuts in a short recording
        "ground": str(recording / "ground.json"),
        "cameras": [{"id": name, "source": str(recording / f"{name}.mp4")} for name in CAMERAS],
    }
    for camera in content["cameras"]:
        if not detects:
            camera["detections"] = str(recording / "gt" / f"{camera['id']}.txt")
        camera.update(sections.get("camera", {}))
    for name, value in sections.items():
        if name != "camera":
            content[name] = {**content.get(name, {}), **value} if isinstance(value, dict) else value
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


@dataclass(slots=True)
class RunningSite:
    """`myview up`, its output, and the events received so far."""

    process: asyncio.subprocess.Process
    config: dict[str, Any]
    lines: list[str] = field(default_factory=list)
    gops: list[Gop] = field(default_factory=list)
    states: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    """States of each camera by the events, the newest last."""
    objects: Objects | None = None
    received: asyncio.Condition = field(default_factory=asyncio.Condition)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.config['http']['port']}/"

    @property
    def pulse(self) -> int:
        """The last decided frame."""
        return self.gops[-1].first + self.gops[-1].frames - 1 if self.gops else -1

    def children(self) -> dict[str, int]:
        """Return the pid of each process of the site, by name: sync, bestview, c0 …"""
        found = {}
        for folder in Path("/proc").iterdir():
            with contextlib.suppress(OSError, ValueError):
                command_line = (folder / "cmdline").read_bytes().decode().split("\0")[:-1]
                parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
                if parent == self.process.pid and "server.cli.main" in command_line:
                    command = command_line[command_line.index("server.cli.main") + 1 :]
                    found[command[2] if command[0] == "camera" else command[0]] = int(folder.name)
        return found

    def state(self, camera: str) -> str | None:
        """Return a camera's last state by the events."""
        return self.states[camera][-1] if self.states[camera] else None

    async def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait until the received events fulfill a condition."""
        try:
            async with asyncio.timeout(PATIENCE), self.received:
                await self.received.wait_for(condition)
        except TimeoutError:
            raise AssertionError(f"{what}: not within {PATIENCE} s\n" + "\n".join(self.lines[-40:])) from None

    async def next_gop(self) -> None:
        """Wait until another GOP is decided."""
        known = len(self.gops)
        await self.until(lambda: len(self.gops) > known, "another GOP")

    async def wait_for_exit(self) -> int:
        """Wait until `myview up` exits; return the exit code."""
        async with asyncio.timeout(PATIENCE):
            return await self.process.wait()

    async def listen(self) -> None:
        """Collect events while the site runs, reconnecting after a restart of the service."""
        async for event in events(self.url, HttpSettings(stream_retries=int(PATIENCE))):
            async with self.received:
                match event:
                    case Gop():
                        self.gops.append(event)
                    case Cameras():
                        for camera in event.cameras:
                            self.states[camera.camera].append(camera.state)
                    case Objects():
                        self.objects = event
                self.received.notify_all()

    async def read_log(self) -> None:
        """Collect the log lines of all processes."""
        assert self.process.stderr is not None
        async for line in self.process.stderr:
            self.lines.append(line.decode().rstrip())


@contextlib.asynccontextmanager
async def running(config: Path, *arguments: str, listen: bool = True) -> AsyncIterator[RunningSite]:
    """Run a site, and terminate it at the end."""
    process = await asyncio.create_subprocess_exec(
        *MYVIEW,
        "up",
        str(config),
        *arguments,
        stderr=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.DEVNULL,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    site = RunningSite(process, yaml.safe_load(config.read_text(encoding="utf-8")))
    tasks = [asyncio.create_task(site.read_log())]
    try:
        if listen:
            await _wait_until_listening(site)
            tasks.append(asyncio.create_task(site.listen()))
        yield site
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGTERM)
        try:
            await asyncio.wait_for(process.wait(), PATIENCE)
        except TimeoutError:
            process.kill()
            await process.wait()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _wait_until_listening(site: RunningSite) -> None:
    """Wait until the best-view service logs that it listens."""
    async with asyncio.timeout(PATIENCE):
        while not any(re.search(r"page, streams and API on http", line) for line in site.lines):
            if site.process.returncode is not None:
                raise AssertionError("`myview up` ended:\n" + "\n".join(site.lines))
            await asyncio.sleep(0.05)


async def with_timeout(work: Awaitable[Any]) -> Any:
    """Await something with a timeout."""
    async with asyncio.timeout(PATIENCE):
        return await work
