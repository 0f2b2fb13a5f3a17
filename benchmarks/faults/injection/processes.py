"""Processes that die or freeze: each in turn, and any two of them at once."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import AsyncIterator

import aiohttp

from benchmarks.faults.injection.process_pairs import BESTVIEW, DRAWING, SHOWN, names, title, turns
from benchmarks.faults.site.fault_site import LEASE_S, Fault, FaultSite, Inject, with_up

_FROZEN_S = 4.0
_SOME_BYTES, _MORE_BYTES = 10_000, 100_000
_AGAIN_S = 0.2


def killed(*processes: str) -> Inject:
    """Kill processes at once."""

    async def inject(stand: FaultSite) -> None:
        stand.send(signal.SIGKILL, *names(stand, processes))

    return inject


def frozen(*processes: str, seconds: float = _FROZEN_S) -> Inject:
    """Stop processes for a while."""

    async def inject(stand: FaultSite) -> None:
        chosen = names(stand, processes)
        stand.send(signal.SIGSTOP, *chosen)
        try:
            await asyncio.sleep(seconds)
        finally:
            stand.send(signal.SIGCONT, *chosen)

    return inject


def while_drawing(inject: Inject, *, breaks: bool) -> Inject:
    """Have a viewer of JPEG, so that there is a drawing process.

    Their stream goes on; where it breaks with its server, it is opened again, and pictures come.
    """

    async def injected(stand: FaultSite) -> None:
        path = f"/objects/{stand.viewers[0].number}/best.mjpeg"
        async with aiohttp.ClientSession(stand.url, raise_for_status=True) as session:
            async with _pictures(session, path) as content:
                await content.readexactly(_SOME_BYTES)
                await inject(stand)
                if not breaks:
                    await content.readexactly(_MORE_BYTES)
                    return
            async with _pictures(session, path) as content:
                await content.readexactly(_MORE_BYTES)

    return injected


@contextlib.asynccontextmanager
async def _pictures(session: aiohttp.ClientSession, path: str) -> AsyncIterator[aiohttp.StreamReader]:
    """Open a stream of JPEG; a busy server, or one that is not there yet, is asked again."""
    while True:
        try:
            answer = await session.get(path)
            break
        except aiohttp.ClientError:
            await asyncio.sleep(_AGAIN_S)
    async with answer:
        yield answer.content


def _kill(processes: tuple[str, ...]) -> Fault:
    name, inject, breaks = f"kill {title(processes)}", killed(*processes), BESTVIEW in processes
    if DRAWING in processes:
        inject = while_drawing(inject, breaks=breaks)
    return Fault(name, with_up, inject, 15.0, None, breaks=True) if breaks else Fault(name, with_up, inject)


def _freeze(processes: tuple[str, ...]) -> Fault:
    inject = frozen(*processes)
    if DRAWING in processes:
        inject = while_drawing(inject, breaks=False)
    within = None if BESTVIEW in processes else LEASE_S + 1.0 if SHOWN in processes else 1.0
    return Fault(f"freeze {title(processes)}", with_up, inject, 9.0, within)


FAULTS = (
    *map(_kill, turns(BESTVIEW)),
    *map(_freeze, turns(BESTVIEW)),
    *map(_freeze, (it for it in turns() if BESTVIEW in it)),
    *map(_kill, (it for it in turns() if BESTVIEW in it)),
)
