"""Processes that die, freeze, or are started again, one by one and in pairs."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Sequence

import aiohttp

from benchmarks.faults_site import LEASE_S, Fault, Inject, Stand, with_up

SHOWN = "shown"
"""The camera that most viewers are shown."""
_FROZEN_S = 4.0


def _names(stand: Stand, names: Sequence[str]) -> list[str]:
    return [stand.shown() if name == SHOWN else name for name in names]


def killed(*names: str) -> Inject:
    """Kill processes at once."""

    async def inject(stand: Stand) -> None:
        for name in _names(stand, names):
            stand.send(name, signal.SIGKILL)

    return inject


def frozen(*names: str, seconds: float = _FROZEN_S) -> Inject:
    """Stop processes for a while."""

    async def inject(stand: Stand) -> None:
        chosen = _names(stand, names)
        for name in chosen:
            stand.send(name, signal.SIGSTOP)
        try:
            await asyncio.sleep(seconds)
        finally:
            for name in chosen:
                stand.send(name, signal.SIGCONT)

    return inject


def while_drawing(inject: Inject) -> Inject:
    """Have a viewer of JPEG, so that there is a drawing process."""

    async def injected(stand: Stand) -> None:
        number = stand.viewers[0].number
        async with (
            aiohttp.ClientSession(stand.url) as session,
            session.get(f"/objects/{number}/best.mjpeg") as answer,
        ):
            await answer.content.readexactly(10_000)
            await inject(stand)
            await answer.content.readexactly(100_000)

    return injected


FAULTS = (
    Fault("kill camera", with_up, killed(SHOWN)),
    Fault("kill sync", with_up, killed("sync")),
    Fault("kill drawing", with_up, while_drawing(killed("drawing"))),
    Fault("kill sync+camera", with_up, killed("sync", SHOWN)),
    Fault("kill camera+drawing", with_up, while_drawing(killed(SHOWN, "drawing"))),
    Fault("freeze camera", with_up, frozen(SHOWN), 9.0, LEASE_S + 1.0),
    Fault("freeze sync", with_up, frozen("sync"), 9.0),
    Fault("freeze drawing", with_up, while_drawing(frozen("drawing")), 9.0),
    Fault("freeze sync+camera", with_up, frozen("sync", SHOWN), 9.0, LEASE_S + 1.0),
    Fault("freeze bestview", with_up, frozen("bestview"), 9.0, None),
    Fault("kill bestview", with_up, killed("bestview"), 15.0, None, breaks=True),
    Fault("kill bestview+camera", with_up, killed("bestview", SHOWN), 15.0, None, breaks=True),
    Fault("kill bestview+sync", with_up, killed("bestview", "sync"), 15.0, None, breaks=True),
)
