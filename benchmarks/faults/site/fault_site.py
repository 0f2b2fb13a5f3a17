"""The site that faults are injected into: real processes, viewers at real sockets, and what is heard."""

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
from benchmarks.latency import running_site as delay_site

LEASE_S = 1.0
"""`zenoh.lease_s` by default."""
_SETTLE_S = 90.0
_POLL_S = 0.05
_SEEN_S = 1.5
"""So long all must be well before a fault."""
SETTINGS: Mapping[str, Mapping[str, Any]] = {
    "sync": {"start_timeout_s": 30.0},
    "record": {"segment_s": 5.0},
}


@dataclass(frozen=True, slots=True)
class ProcessExit:
    """A process that was told to end."""

    name: str
    seconds: float
    code: int | None
    """None where it did not end by itself."""

    @property
    def well(self) -> bool:
        """Within 2 s and with 0."""
        return self.code == 0 and self.seconds <= 2.0


@dataclass(slots=True)
class FaultSite:
    """A site that runs, and what is heard of it."""

    url: str
    folder: Path
    main: int
    """The process that all others are children of; 0: they were started one by one."""
    told: EventLog = field(default_factory=EventLog)
    viewers: list[Viewer] = field(default_factory=list)
    ended: list[ProcessExit] = field(default_factory=list)
    returned: list[float] = field(default_factory=list)
    """When the server answered again after it had not."""
    live: tuple[str, ...] = ()
    """Cameras that are no recordings."""
    control: Any = None
    """What the faults of this site are injected by, if not signals."""
    recorded: Path = Path()
    page_at: float | None = None
    """When the page had new pictures again."""
    views: StampedViews | None = None
    """What it plays, where that is not what all sites play."""

    def pids(self, name: str) -> list[int]:
        """Return processes of a name: sync, bestview, drawing, or a camera's id; none where it is down."""
        return running_pids(f"camera {name}" if name in CAMERAS else name)

    def send(self, number: signal.Signals, *names: str) -> None:
        """Send a signal to the processes of these names, as nearly at once as can be.

        Raises:
            RuntimeError: there is none of a name.
        """
        pids = {name: self.pids(name) for name in names}
        for name in names:
            if not pids[name]:
                raise RuntimeError(f"there is no process {name}")
        for pid in chain.from_iterable(pids.values()):
            with contextlib.suppress(ProcessLookupError):  # it has ended since, with the one before it
                os.kill(pid, number)

    def shown(self) -> list[str]:
        """Return the cameras, first the one that most viewers are shown; of several the first by its name."""
        cameras = [self.told.shown(viewer.number) for viewer in self.viewers]
        return sorted(CAMERAS, key=lambda name: (-cameras.count(name), name))

    async def settle(self) -> None:
        """Wait until all cameras are live, and decisions come one after the other, of people who are shown.

        Raises:
            RuntimeError: that does not happen.
        """
        give_up = time.monotonic() + _SETTLE_S
        well_since = None
        while time.monotonic() < give_up:
            now = time.monotonic()
            if not self._is_well(now):
                well_since = None
            elif well_since is None:
                well_since = now
            elif now - well_since > _SEEN_S:
                return
            await asyncio.sleep(_POLL_S)
        states = {name: self.told.state(name) for name in CAMERAS}
        raise RuntimeError(f"the site did not recover within {_SETTLE_S:g} s: {states}")

    def _is_well(self, now: float) -> bool:
        if not self.told.gops or any(self.told.state(name) != "live" for name in CAMERAS):
            return False
        at, gop = self.told.gops[-1]
        return now - at < _SEEN_S and any(gop.choices.values())

    def people(self, most: int) -> list[int]:
        """Return the numbers of people who are shown now."""
        choices = self.told.gops[-1][1].choices
        return sorted(number for number, camera in choices.items() if camera)[:most]

    async def watch_server(self) -> None:
        """Note when the server is ready again after it was not, until cancelled."""
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
                self.returned.append(time.monotonic())
            answered = ready
            await asyncio.sleep(_POLL_S)


@contextlib.asynccontextmanager
async def listening(stand: FaultSite) -> AsyncIterator[FaultSite]:
    """Follow the events of a site, and wait until it is well."""
    tasks = [asyncio.create_task(stand.told.listen(stand.url)), asyncio.create_task(stand.watch_server())]
    try:
        await stand.settle()
        yield stand
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
    """Run `myview up`, which starts again what dies; in the end tell it to end."""
    recorded = folder / "kept"
    content = {name: dict(values) for name, values in SETTINGS.items()}
    content["record"]["folder"] = str(recorded)
    for name, values in (settings or {}).items():
        content[name] = {**content.get(name, {}), **values}
    async with delay_site.running_site(views, folder, environment, content) as site:
        stand = FaultSite(site.url, folder, site.process.pid, recorded=recorded)
        async with listening(stand):
            yield stand
            stand.ended.append(await told_to_end("up", site.process))


async def told_to_end(name: str, process: asyncio.subprocess.Process) -> ProcessExit:
    """Send a process SIGTERM; return when and how it exits."""
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
Alone = Callable[[StampedViews, Path], Awaitable[list[ProcessExit]]]
Setup = Callable[[StampedViews, Path], contextlib.AbstractAsyncContextManager[FaultSite]]


async def _nothing(stand: FaultSite) -> None:
    """Leave it as it is."""
    del stand


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that goes wrong.

    Attributes:
        name: for the command line and the table.
        setup: the site that it happens to; faults of one site follow each other.
        inject: makes it happen, and takes as long as it lasts.
        seconds: for how long viewers are watched from when it begins.
        within: promised: so many seconds at most without a fresh picture; None: nobody is there to take over.
        breaks: it is the viewers' own server that dies.
        alone: does all by itself, with sites of its own, and gives what was told to end.
        unrecorded: meanwhile nothing can be recorded.
    """

    name: str
    setup: Setup
    inject: Inject = _nothing
    seconds: float = 6.0
    within: float | None = 1.0
    breaks: bool = False
    alone: Alone | None = None
    unrecorded: bool = False
