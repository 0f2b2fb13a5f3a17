"""The supervisor: starts all processes of a site on one machine, and restarts those that die."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from expbackoff import Backoff
from logthrottle import LogThrottle
from server.config.site_config import Config
from server.supervisor.shutdown import EXIT_FINISHED, EXIT_RESTART, SUPERVISED_VARIABLE
from server.supervisor.startup_signal import STARTED_FD_VARIABLE, StartupPipe, open_startup_pipe
from server.system.child_process import start_cli_command
from server.system.errors import UserError
from server.system.processors import available_processors

log = logging.getLogger(__name__)

_RETRY_FIRST_S, _RETRY_MAX_S = 0.2, 10.0
_STABLE_S = 10.0
"""Running time after which a process is restarted without backoff again."""
_REFUSAL_S = 60.0
"""Time since a process has loaded in which it may refuse its input: it first opens and checks its source."""
_STARTUP_TIMEOUT_S = 10.0
"""How long a loading process delays the start of others; it may hang."""
_KILL_AFTER_S = 1.6
"""Time from SIGTERM to SIGKILL; processes exit by themselves a little sooner."""


@dataclass(slots=True)
class Child:
    """A supervised process and its state."""

    name: str
    arguments: Sequence[str]
    awaits: Sequence[Child] = ()
    """Processes that must have started first."""
    niceness: int = 0
    """Niceness added to the supervisor's."""
    process: asyncio.subprocess.Process | None = None
    restarts: int = 0
    deaths: LogThrottle = field(default_factory=LogThrottle)
    started: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when it has loaded once, or has timed out."""
    done: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when it has exited with nothing left to do."""


class Supervisor:
    """Starts one process each for the pulses, every camera and the best view, and restarts those that die.

    A camera whose recording is over exits with `EXIT_FINISHED` and is not restarted; when the best-view
    service does, the whole site ends, and so it does when that service exits with `EXIT_RESTART`.
    ``before_start`` is called whenever a process is about to be started. A process that refuses its input at
    its first start ends the site, unless the site ``has_run`` with this configuration.

    The best view and the pulse server start first. Then the cameras, of which only as many load at a time as
    there are processors: the site answers meanwhile.
    """

    def __init__(
        self,
        config_path: Path,
        config: Config,
        environment: Mapping[str, str],
        out: Path | None,
        before_start: Callable[[], None] = lambda: None,
        *,
        has_run: bool = False,
    ) -> None:
        self._before_start, self._has_run = before_start, has_run
        self._environment = {**os.environ, **environment, SUPERVISED_VARIABLE: "1"}
        path = str(config_path)
        self._out = out
        self._load_slots = asyncio.Semaphore(max(1, int(available_processors())))
        """Slots for cameras that are loading."""
        first = [Child("bestview", ["bestview", path]), Child("sync", ["sync", path])]
        cameras = [
            Child(camera, ["camera", path, camera], first, config.site.niceness)
            for camera in config.camera_ids
        ]
        gateway = [Child("rtsp", ["rtsp", path], first[:1])] if config.rtsp.enabled else []
        self.children = [*first, *gateway, *cameras]
        self.restart_wanted = False
        """Whether the site ended because an operator wants it to start again."""

    async def run(self) -> None:
        """Run everything until the best-view service has nothing left to do, or this task is cancelled.

        Raises:
            UserError: a process refused its input; its error is in the log above.
        """
        watchers = [asyncio.create_task(self._watch(child), name=child.name) for child in self.children]
        site_done = asyncio.create_task(self.children[0].done.wait())
        try:
            finished, _ = await asyncio.wait([site_done, *watchers], return_when=asyncio.FIRST_COMPLETED)
            while site_done not in finished:
                for watcher in finished:
                    watcher.result()  # raises UserError if a process refused its input
                pending = [watcher for watcher in watchers if not watcher.done()]
                finished, _ = await asyncio.wait([site_done, *pending], return_when=asyncio.FIRST_COMPLETED)
        finally:
            site_done.cancel()
            await self._end(watchers)

    def reload(self, name: str) -> None:
        """Send SIGHUP to a running process; one that is restarted reads the configuration anyway."""
        for child in self.children:
            if child.name == name and child.process is not None and child.process.returncode is None:
                child.process.send_signal(signal.SIGHUP)

    async def _watch(self, child: Child) -> None:
        backoff = Backoff(_RETRY_FIRST_S, _RETRY_MAX_S)
        loop = asyncio.get_running_loop()
        for prerequisite in child.awaits:
            await prerequisite.started.wait()
        while True:
            with open_startup_pipe() as pipe:
                async with self._load_slots if child.awaits else contextlib.nullcontext():
                    started = loop.time()
                    process = await self._start(child, pipe)
                code = await process.wait()
            has_run = self._has_run or child.restarts > 0 or _seconds_since(pipe.ended_at) > _REFUSAL_S
            if code == EXIT_RESTART:
                self.restart_wanted = True
                child.done.set()
                return
            if code == EXIT_FINISHED:
                log.info("%s has ended", child.name)
                child.done.set()
                return
            if code == UserError.code and not has_run:
                raise UserError(f"{child.name} could not start")
            if loop.time() - started > _STABLE_S:
                backoff.reset()
            cause, pause = _cause(code), backoff.next()
            if (more := child.deaths.record(cause)) is not None:
                log.warning("%s %s%s; starting it again in %.1f s", child.name, cause, more, pause)
            await asyncio.sleep(pause)
            child.restarts += 1

    async def _start(self, child: Child, pipe: StartupPipe) -> asyncio.subprocess.Process:
        """Start a process; return it once it has loaded, has died, or has timed out."""
        try:
            self._before_start()
            process = child.process = await start_cli_command(
                self._arguments(child),
                {**self._environment, STARTED_FD_VARIABLE: str(pipe.write_end)},
                inherited=(pipe.write_end,),
                niceness=child.niceness,
            )
        finally:
            os.close(pipe.write_end)
        await pipe.ended(_STARTUP_TIMEOUT_S)
        child.started.set()
        return process

    def _arguments(self, child: Child) -> Sequence[str]:
        """Return a process's arguments; a restarted best view writes into a new folder."""
        if self._out is None or child is not self.children[0]:
            return child.arguments
        out = self._out / f"restart-{child.restarts}" if child.restarts else self._out
        return [*child.arguments, "--out", str(out)]

    async def _end(self, watchers: Sequence[asyncio.Task[None]]) -> None:
        for watcher in watchers:
            watcher.cancel()
        await asyncio.gather(*watchers, return_exceptions=True)
        processes = [child.process for child in self.children if child.process is not None]
        running = [process for process in processes if process.returncode is None]
        for process in running:
            process.terminate()
        _, late = (
            await asyncio.wait(
                [asyncio.create_task(process.wait()) for process in running], timeout=_KILL_AFTER_S
            )
            if running
            else ((), ())
        )
        if late:
            for process in running:
                if process.returncode is None:
                    process.kill()
            await asyncio.wait(late)


def _seconds_since(moment: float | None) -> float:
    return 0.0 if moment is None else asyncio.get_running_loop().time() - moment


def _cause(code: int) -> str:
    if code == 0:
        return "was terminated from outside"
    return f"died (killed by signal {-code})" if code < 0 else f"died (exit code {code})"
