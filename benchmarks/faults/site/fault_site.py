"""The site that faults are injected into: its processes, viewers and events."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import aiohttp

from benchmarks.common.process_load import running_pids
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews
from benchmarks.faults.viewing.viewers import EventLog, Viewer
from benchmarks.latency import running_site as latency_site

LEASE_S = 1.0
"""`zenoh.lease_s` by default."""
_SETTLE_S = 90.0
_POLL_S = 0.05
_HEALTHY_S = 1.5
"""Seconds for which the site must be healthy before a fault."""
SETTINGS: Mapping[str, Mapping[str, Any]] = {
    "sync": {"start_timeout_s": 30.0},
    "record": {"segment_s": 5.0},
}


@dataclass(frozen=True, slots=True)
class ProcessExit:
    """How a process exited after SIGTERM."""

    name: str
    seconds: float
    code: int | None
    """The exit code; None if it had to be killed."""

    @property
    def clean(self) -> bool:
        """Whether it exited within 2 s with code 0."""
        return self.code == 0 and self.seconds <= 2.0


@dataclass(slots=True)
class FaultSite:
    """A running site with its viewers and the log of its events."""

    url: str
    folder: Path
    supervisor_pid: int
    """The supervisor's process; 0: the processes run separately."""
    events: EventLog = field(default_factory=EventLog)
    viewers: list[Viewer] = field(default_factory=list)
    exits: list[ProcessExit] = field(default_factory=list)
    ready_times: list[float] = field(default_factory=list)
    """When the server became ready again, by the monotonic clock."""
    live: tuple[str, ...] = ()
    """Network cameras."""
    control: Any = None
    """The handle for injecting faults other than signals."""
    recorded: Path = Path()
    page_resumed_at: float | None = None
    """When the page showed new video again."""
    views: StampedViews | None = None
    """Its views, where they differ from those of other sites."""

    def pids(self, name: str) -> list[int]:
        """Return the pids of a process: sync, bestview, rendering, or a camera's id; empty if it is down."""
        return running_pids(f"camera {name}" if name in CAMERAS else name)

    def send(self, number: signal.Signals, *names: str) -> None:
        """Send a signal to the processes of these names, as simultaneously as possible.

        Raises:
            RuntimeError: a process is not running.
        """
        pids = {name: self.pids(name) for name in names}
        for name in names:
            if not pids[name]:
                raise RuntimeError(f"there is no process {name}")
        for pid in chain.from_iterable(pids.values()):
            with contextlib.suppress(ProcessLookupError):  # it exited with the previous process
                os.kill(pid, number)

    def shown(self) -> list[str]:
        """Return the cameras by the number of viewers that are shown them, then by name."""
        cameras = [self.events.shown(viewer.number) for viewer in self.viewers]
        return sorted(CAMERAS, key=lambda name: (-cameras.count(name), name))

    async def settle(self, seconds: float = _SETTLE_S) -> None:
        """Wait until the site is healthy: all cameras live, and decisions arriving that show people.

        Raises:
            RuntimeError: the site does not become healthy in time.
        """
        deadline = time.monotonic() + seconds
        healthy_since = None
        while time.monotonic() < deadline:
            now = time.monotonic()
            if not self._is_healthy(now):
                healthy_since = None
            elif healthy_since is None:
                healthy_since = now
            elif now - healthy_since > _HEALTHY_S:
                return
            await asyncio.sleep(_POLL_S)
        states = {name: self.events.state(name) for name in CAMERAS}
        raise RuntimeError(f"the site did not recover within {seconds:g} s: {states}")

    def _is_healthy(self, now: float) -> bool:
        if not self.events.gops or any(self.events.state(name) != "live" for name in CAMERAS):
            return False
        at, gop = self.events.gops[-1]
        return now - at < _HEALTHY_S and any(gop.choices.values())

    def people(self, count: int) -> list[int]:
        """Return the numbers of at most `count` people who are shown now."""
        choices = self.events.gops[-1][1].choices
        return sorted(number for number, camera in choices.items() if camera)[:count]

    async def watch_server(self) -> None:
        """Record when the server becomes ready again, until cancelled."""
        answered = True
        timeout = aiohttp.ClientTimeout(total=1.0)
        while True:
            try:
                async with (
                    aiohttp.ClientSession(timeout=timeout) as session,
                    session.get(f"{self.url}readyz") as answer,
                ):
                    ready = answer.ok
            except (aiohttp.ClientError, TimeoutError):
                ready = False
            if ready and not answered:
                self.ready_times.append(time.monotonic())
            answered = ready
            await asyncio.sleep(_POLL_S)


@contextlib.asynccontextmanager
async def follow_events(fault_site: FaultSite, start_s: float = _SETTLE_S) -> AsyncIterator[FaultSite]:
    """Follow the events of a site, and wait until it is healthy, so many seconds at most."""
    tasks = [
        asyncio.create_task(fault_site.events.listen(fault_site.url)),
        asyncio.create_task(fault_site.watch_server()),
    ]
    try:
        await fault_site.settle(start_s)
        yield fault_site
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


@contextlib.asynccontextmanager
async def with_up(
    views: StampedViews,
    folder: Path,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    environment: Mapping[str, str] | None = None,
) -> AsyncIterator[FaultSite]:
    """Run `myview up`, which restarts killed processes; terminate it in the end."""
    recorded = folder / "kept"
    content = {name: dict(values) for name, values in SETTINGS.items()}
    content["record"]["folder"] = str(recorded)
    for name, values in (settings or {}).items():
        content[name] = {**content.get(name, {}), **values}
    async with latency_site.running_site(views, folder, environment, content) as site:
        fault_site = FaultSite(site.url, folder, site.process.pid, recorded=recorded)
        async with follow_events(fault_site):
            yield fault_site
            fault_site.exits.append(await terminate_process("up", site.process))


async def terminate_process(name: str, process: asyncio.subprocess.Process) -> ProcessExit:
    """Send a process SIGTERM; return how it exits."""
    begun = time.monotonic()
    process.terminate()
    try:
        code = await asyncio.wait_for(process.wait(), 20.0)
    except TimeoutError:
        process.kill()
        await process.wait()
        return ProcessExit(name, time.monotonic() - begun, None)
    return ProcessExit(name, time.monotonic() - begun, code)


Inject = Callable[[FaultSite], Awaitable[None]]
Standalone = Callable[[StampedViews, Path], Awaitable[list[ProcessExit]]]
Setup = Callable[[StampedViews, Path], contextlib.AbstractAsyncContextManager[FaultSite]]


async def _no_fault(fault_site: FaultSite) -> None:
    """Inject nothing."""
    del fault_site


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault that is injected.

    Attributes:
        name: on the command line and in the table.
        setup: the site that it is injected into; consecutive faults of one setup share a site.
        inject: injects the fault, and returns when it is over.
        seconds: time for which viewers are observed, from the start of the fault.
        max_gap_s: promised maximum time without a fresh picture, seconds; None: no promise.
        kills_server: whether the viewers' server is killed.
        standalone: runs separate sites instead, and returns the exits of their processes.
        stops_recording: whether nothing can be recorded during the fault.
    """

    name: str
    setup: Setup
    inject: Inject = _no_fault
    seconds: float = 6.0
    max_gap_s: float | None = 1.0
    kills_server: bool = False
    standalone: Standalone | None = None
    stops_recording: bool = False
