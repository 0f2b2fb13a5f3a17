"""Messages that are lost, doubled or in another order, and a router that is gone."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator
from pathlib import Path

from benchmarks.faults_film import Views
from benchmarks.faults_site import Fault, Inject, Stand, with_up
from benchmarks.surroundings import one_thread_environment
from server.run.setup import free_port

_GONE_S = 30.0
_FAULTY_S = 8.0


class _Middle:
    """The process in the middle (:mod:`benchmarks.faults_bus`)."""

    def __init__(self, listen: str, connect: str) -> None:
        self._words = ["-m", "benchmarks.faults_bus", listen, connect]
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        pipe, environment = asyncio.subprocess.PIPE, one_thread_environment()
        self._process = await asyncio.create_subprocess_exec(
            sys.executable, *self._words, stdin=pipe, stdout=pipe, env=environment
        )

    async def say(self, word: str) -> int:
        """Say how messages pass from now on; give how many have not passed plainly so far."""
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            return 0
        process.stdin.write(f"{word}\n".encode())
        return int(await process.stdout.readline() or b"0")

    async def kill(self) -> None:
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()


@contextlib.asynccontextmanager
async def with_middle(views: Views, folder: Path) -> AsyncIterator[Stand]:
    """Run a site whose cameras connect to a process in the middle."""
    near, far = (f"tcp/127.0.0.1:{free_port()}" for _ in range(2))
    middle = _Middle(near, far)
    await middle.start()
    try:
        async with with_up(views, folder, {"zenoh": {"connect": near, "listen": far}}) as stand:
            stand.control = middle
            yield stand
    finally:
        await middle.kill()


def passed(how: str) -> Inject:
    """Let messages pass in some way for a while."""

    async def inject(stand: Stand) -> None:
        before = await stand.control.say(how)
        await asyncio.sleep(_FAULTY_S)
        if await stand.control.say("plain") <= before:
            raise RuntimeError("nothing has befallen any message")

    return inject


async def router_gone(stand: Stand) -> None:
    """Kill the router, and start it again after a while."""
    await stand.control.kill()
    await asyncio.sleep(_GONE_S)
    await stand.control.start()


FAULTS = (
    Fault("messages: 30 % lost", with_middle, passed("lost"), 10.0),
    Fault("messages: 30 % doubled", with_middle, passed("doubled"), 10.0),
    Fault("messages: 30 % disordered", with_middle, passed("disordered"), 10.0),
    Fault("router gone 30 s", with_middle, router_gone, 40.0, None),
)
