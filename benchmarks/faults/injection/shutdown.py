"""Shutdown at awkward moments: right after the start, and while clients are connected."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import sys
import time
from pathlib import Path

import aiohttp

from benchmarks.common.environment import one_thread_environment
from benchmarks.faults.injection.separate_processes import NAMES, SeparateProcesses, write_config
from benchmarks.faults.site.fault_site import Fault, FaultSite, ProcessExit, terminate_process, with_up
from benchmarks.faults.video.stamped_views import StampedViews
from benchmarks.faults.viewing.viewers import Viewer

_MOMENTS_S = (0.0, 1.0, 3.0)
"""Seconds after the process has installed its SIGTERM handler."""
_POLL_S = 0.005
_WATCHED_S = 4.0
_LINGER_S = 2.0


async def shut_down_right_after_start(views: StampedViews, folder: Path) -> list[ProcessExit]:
    """Start a site, and each process separately, and terminate them soon after."""
    config, _ = await asyncio.to_thread(write_config, views, folder)
    exits = []
    with (folder / "site.log").open("w", encoding="utf-8") as log:
        for moment in _MOMENTS_S:
            site = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "server.cli.main", "up", str(config)),
                env=one_thread_environment(),
                stdout=log,
                stderr=log,
            )
            await _wait_for_sigterm_handler(site)
            await asyncio.sleep(moment)
            exits.append(await terminate_process(f"up after {moment:g} s", site))
        for moment in _MOMENTS_S:
            single = SeparateProcesses(config, log)
            for name in NAMES:
                await single.start(name)
            await asyncio.gather(
                *(_wait_for_sigterm_handler(process) for process in single.processes.values())
            )
            await asyncio.sleep(moment)
            exits += await asyncio.gather(
                *(
                    terminate_process(f"{name} after {moment:g} s", process)
                    for name, process in single.processes.items()
                )
            )
    return exits


async def _wait_for_sigterm_handler(process: asyncio.subprocess.Process) -> None:
    """Wait until a process handles SIGTERM (proc(5), SigCgt), or has exited."""
    status = Path(f"/proc/{process.pid}/status")
    while process.returncode is None:
        lines = (await asyncio.to_thread(status.read_text, encoding="ascii")).splitlines()
        caught = next((line.split()[1] for line in lines if line.startswith("SigCgt")), "0")
        if int(caught, 16) >> signal.SIGTERM - 1 & 1:
            return
        await asyncio.sleep(_POLL_S)


async def shut_down_while_watched(views: StampedViews, folder: Path) -> list[ProcessExit]:
    """Shut a site down while a client of every kind is connected.

    Raises:
        RuntimeError: a stream ends before the shutdown.
    """
    paths = ("objects/{0}/best.mp4", "objects/{0}/best.ts", "objects/{0}/best.mjpeg", "cameras/c0/live.mp4")
    async with (
        aiohttp.ClientSession() as session
    ):  # open for longer than the site: no client disconnects first
        async with with_up(views, folder) as fault_site:
            viewer = Viewer(fault_site.url, fault_site.people(1)[0])
            tasks = [asyncio.create_task(viewer.run())]
            tasks += [
                asyncio.create_task(_read(session, fault_site.url + path.format(viewer.number)))
                for path in paths
            ]
            await asyncio.sleep(_WATCHED_S)
            if any(task.done() for task in tasks):
                raise RuntimeError("a stream ended before the shutdown")
            before = _site_processes(fault_site)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    left = await _still_running(before)
    return [*fault_site.exits, *(ProcessExit(f"{name} is still running", 0.0, None) for name in left)]


def _site_processes(fault_site: FaultSite) -> list[tuple[str, int]]:
    return [(name, pid) for name in (*NAMES, "rendering") for pid in fault_site.pids(name)]


async def _still_running(before: list[tuple[str, int]]) -> list[str]:
    """Return the processes that are still running a moment after their supervisor exited."""
    deadline = time.monotonic() + _LINGER_S
    while (left := [name for name, pid in before if pid in _running()]) and time.monotonic() < deadline:  # noqa: ASYNC110
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
    Fault("end right after start", with_up, standalone=shut_down_right_after_start),
    Fault("end while watched", with_up, standalone=shut_down_while_watched),
)
