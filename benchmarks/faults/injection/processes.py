"""Kills and freezes of processes, alone and in pairs."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import AsyncIterator

import aiohttp

from benchmarks.faults.injection.process_pairs import BESTVIEW, RENDERING, SHOWN, names, process_sets, title
from benchmarks.faults.site.fault_site import LEASE_S, Fault, FaultSite, Inject, with_up

_FROZEN_S = 4.0
_FIRST_BYTES, _LATER_BYTES = 10_000, 100_000
_RETRY_S = 0.2


def kill_processes(*processes: str) -> Inject:
    """Kill processes (SIGKILL)."""

    async def inject(fault_site: FaultSite) -> None:
        fault_site.send(signal.SIGKILL, *names(fault_site, processes))

    return inject


def freeze_processes(*processes: str, seconds: float = _FROZEN_S) -> Inject:
    """Freeze processes for a while (SIGSTOP)."""

    async def inject(fault_site: FaultSite) -> None:
        chosen = names(fault_site, processes)
        fault_site.send(signal.SIGSTOP, *chosen)
        try:
            await asyncio.sleep(seconds)
        finally:
            fault_site.send(signal.SIGCONT, *chosen)

    return inject


def while_rendering(inject: Inject, *, kills_server: bool) -> Inject:
    """Watch an MJPEG stream during the fault, so that there is a render worker.

    The stream must continue; if its server is killed, it is opened again.
    """

    async def injected(fault_site: FaultSite) -> None:
        path = f"/objects/{fault_site.viewers[0].number}/best.mjpeg"
        async with aiohttp.ClientSession(fault_site.url, raise_for_status=True) as session:
            async with _pictures(session, path) as content:
                await content.readexactly(_FIRST_BYTES)
                await inject(fault_site)
                if not kills_server:
                    await content.readexactly(_LATER_BYTES)
                    return
            async with _pictures(session, path) as content:
                await content.readexactly(_LATER_BYTES)

    return injected


@contextlib.asynccontextmanager
async def _pictures(session: aiohttp.ClientSession, path: str) -> AsyncIterator[aiohttp.StreamReader]:
    """Open an MJPEG stream; retry while the server is busy or not up yet."""
    while True:
        try:
            answer = await session.get(path)
            break
        except aiohttp.ClientError:
            await asyncio.sleep(_RETRY_S)
    async with answer:
        yield answer.content


def _kill(processes: tuple[str, ...]) -> Fault:
    name, inject, kills_server = f"kill {title(processes)}", kill_processes(*processes), BESTVIEW in processes
    if RENDERING in processes:
        inject = while_rendering(inject, kills_server=kills_server)
    return (
        Fault(name, with_up, inject, 15.0, None, kills_server=True)
        if kills_server
        else Fault(name, with_up, inject)
    )


def _freeze(processes: tuple[str, ...]) -> Fault:
    inject = freeze_processes(*processes)
    if RENDERING in processes:
        inject = while_rendering(inject, kills_server=False)
    max_gap_s = None if BESTVIEW in processes else LEASE_S + 1.0 if SHOWN in processes else 1.0
    return Fault(f"freeze {title(processes)}", with_up, inject, 9.0, max_gap_s)


FAULTS = (
    *map(_kill, process_sets(BESTVIEW)),
    *map(_freeze, process_sets(BESTVIEW)),
    *map(_freeze, (processes for processes in process_sets() if BESTVIEW in processes)),
    *map(_kill, (processes for processes in process_sets() if BESTVIEW in processes)),
)
