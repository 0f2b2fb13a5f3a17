"""Sites and processes that are told to end at awkward moments."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import sys
import time
from pathlib import Path

import aiohttp

from benchmarks.common.environment import one_thread_environment
from benchmarks.faults.injection.separate_processes import NAMES, SeparateProcesses, configured
from benchmarks.faults.site.fault_site import Fault, FaultSite, ProcessExit, told_to_end, with_up
from benchmarks.faults.video.stamped_views import StampedViews
from benchmarks.faults.viewing.viewers import Viewer

_MOMENTS_S = (0.0, 1.0, 3.0)
"""After the first line of ours: before it the interpreter itself starts, and ends as any does."""
_POLL_S = 0.005
_WATCHED_S = 4.0
_MOMENT_S = 2.0


async def right_after_start(views: StampedViews, folder: Path) -> list[ProcessExit]:
    """Start a site, and each process for itself, and tell them to end soon after."""
    config, _ = await asyncio.to_thread(configured, views, folder)
    ended = []
    with (folder / "site.log").open("w", encoding="utf-8") as log:
        for moment in _MOMENTS_S:
            site = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "server.cli.main", "up", str(config)),
                env=one_thread_environment(),
                stdout=log,
                stderr=log,
            )
            await _begun(site)
            await asyncio.sleep(moment)
            ended.append(await told_to_end(f"up after {moment:g} s", site))
        for moment in _MOMENTS_S:
            single = SeparateProcesses(config, log)
            for name in NAMES:
                await single.start(name)
            await asyncio.gather(*(_begun(it) for it in single.processes.values()))
            await asyncio.sleep(moment)
            ended += await asyncio.gather(
                *(told_to_end(f"{name} after {moment:g} s", it) for name, it in single.processes.items())
            )
    return ended


async def _begun(process: asyncio.subprocess.Process) -> None:
    """Wait until a process looks after SIGTERM itself (proc(5), SigCgt), or has ended."""
    status = Path(f"/proc/{process.pid}/status")
    while process.returncode is None:
        lines = (await asyncio.to_thread(status.read_text, encoding="ascii")).splitlines()
        caught = next((line.split()[1] for line in lines if line.startswith("SigCgt")), "0")
        if int(caught, 16) >> signal.SIGTERM - 1 & 1:
            return
        await asyncio.sleep(_POLL_S)


async def while_watched(views: StampedViews, folder: Path) -> list[ProcessExit]:
    """Shut a site down while a client of every kind is connected.

    Raises:
        RuntimeError: somebody does not.
    """
    ways = ("objects/{0}/best.mp4", "objects/{0}/best.ts", "objects/{0}/best.mjpeg", "cameras/c0/live.mp4")
    async with aiohttp.ClientSession() as session:  # open for longer than the site: nobody hangs up first
        async with with_up(views, folder) as stand:
            viewer = Viewer(stand.url, stand.people(1)[0])
            tasks = [asyncio.create_task(viewer.run())]
            tasks += [
                asyncio.create_task(_read(session, stand.url + way.format(viewer.number))) for way in ways
            ]
            await asyncio.sleep(_WATCHED_S)
            if any(task.done() for task in tasks):
                raise RuntimeError("a stream has ended before the site was told to end")
            before = _below(stand)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    left = await _left(before)
    return [*stand.ended, *(ProcessExit(f"{name} is left behind", 0.0, None) for name in left)]


def _below(stand: FaultSite) -> list[tuple[str, int]]:
    return [(name, pid) for name in (*NAMES, "drawing") for pid in stand.pids(name)]


async def _left(before: list[tuple[str, int]]) -> list[str]:
    """Return who is still there: whose supervisor has ended may end a moment after it."""
    give_up = time.monotonic() + _MOMENT_S
    while (left := [name for name, pid in before if pid in _running()]) and time.monotonic() < give_up:  # noqa: ASYNC110
        await asyncio.sleep(_POLL_S)
    return left


def _running() -> frozenset[int]:
    return frozenset(int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdecimal())


async def _read(session: aiohttp.ClientSession, address: str) -> None:
    with contextlib.suppress(aiohttp.ClientError):
        async with session.get(address) as answer:
            async for _ in answer.content.iter_any():
                pass


FAULTS = (
    Fault("end right after start", with_up, alone=right_after_start),
    Fault("end while watched", with_up, alone=while_watched),
)
