"""A simulated machine on which a supervisor starts processes."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fakes.service.scripted_cameras import CAMERAS, small_config
from server.supervisor.startup_signal import STARTED_FD_VARIABLE
from server.supervisor.supervisor import Supervisor

NOBODY = 2**22 + 1  # more than a process's number can be (proc(5), pid_max)


class Process:
    """A simulated process; ``ready`` is the descriptor that it closes once it has loaded."""

    pid = NOBODY

    def __init__(self, arguments: tuple[str, ...], environment: Mapping[str, str], ready: int) -> None:
        self.arguments, self.environment = arguments, environment
        self._ready: int | None = ready
        self.returncode: int | None = None
        self._over = asyncio.Event()

    def loaded(self) -> None:
        if self._ready is not None:
            os.close(self._ready)
        self._ready = None

    def end(self, code: int) -> None:
        self.loaded()
        self.returncode = code
        self._over.set()

    async def wait(self) -> int:
        await self._over.wait()
        assert self.returncode is not None
        return self.returncode

    def terminate(self) -> None:
        self.end(-15)

    kill = terminate


class Machine:
    """A simulated machine for a supervisor; processes load at once, or when the test lets them."""

    def __init__(self) -> None:
        self.loads_at_once = True
        self.started: asyncio.Queue[Process] = asyncio.Queue()
        self.task: asyncio.Task[None] | None = None
        self.supervisor: Supervisor | None = None

    async def start(self, *command: str, env: dict[str, str], pass_fds: tuple[int], **_: Any) -> Process:
        assert env[STARTED_FD_VARIABLE] == str(pass_fds[0])
        process = Process(command[3:], env, os.dup(pass_fds[0]))
        if self.loads_at_once:
            process.loaded()
        self.started.put_nowait(process)
        return process

    async def processes(self, count: int) -> dict[str, Process]:
        """Return the next started processes by role."""
        found = [await self.started.get() for _ in range(count)]
        return {
            process.arguments[-1 if process.arguments[0] == "camera" else 0]: process for process in found
        }

    async def nothing_more(self) -> None:
        """Check that no other process is started."""
        for _ in range(20):  # turns of the event loop
            await asyncio.sleep(0)
        assert self.started.empty()

    def run(
        self,
        out: Path | None = None,
        before_start: Callable[[], None] = lambda: None,
        cameras: tuple[str, ...] = CAMERAS,
    ) -> asyncio.Task[None]:
        self.supervisor = Supervisor(Path("site.yaml"), small_config(cameras=cameras), {}, out, before_start)
        self.task = asyncio.create_task(self.supervisor.run())
        return self.task
