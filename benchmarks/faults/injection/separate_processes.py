"""Sites whose processes run separately, as in containers, and restarts of these processes."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import yaml

from benchmarks.common.environment import one_thread_environment
from benchmarks.faults.injection.process_pairs import BESTVIEW, RENDERING, names, process_sets, title
from benchmarks.faults.site.fault_site import (
    SETTINGS,
    Fault,
    FaultSite,
    Inject,
    ProcessExit,
    follow_events,
    terminate_process,
)
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews
from server.cli.generated_config import free_port

NAMES = ("bestview", "sync", *CAMERAS)


class SeparateProcesses:
    """Processes that are started one by one.

    By process name ``environments`` adds variables, and ``prefixes`` the words before the command, such as
    those that run it in a network namespace.
    """

    def __init__(
        self,
        config: Path,
        log: IO[str],
        environments: Mapping[str, Mapping[str, str]] | None = None,
        prefixes: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        self._config, self._log, self._environments = config, log, environments or {}
        self._prefixes = prefixes or {}
        self.processes: dict[str, asyncio.subprocess.Process] = {}

    async def start(self, name: str) -> None:
        """Start a process; ``bestview-1`` is one of several best-view services."""
        command = name.partition("-")[0]
        words = ["camera", str(self._config), name] if name in CAMERAS else [command, str(self._config)]
        self.processes[name] = await asyncio.create_subprocess_exec(
            *(*self._prefixes.get(name, ()), sys.executable, "-m", "server.cli.main", *words),
            env={**one_thread_environment(), "MYVIEW_SUPERVISED": "1", **self._environments.get(name, {})},
            stdout=self._log,
            stderr=self._log,
        )

    async def terminate(self) -> list[ProcessExit]:
        """Terminate all processes."""
        running = {name: process for name, process in self.processes.items() if process.returncode is None}
        return await asyncio.gather(*(terminate_process(*process) for process in running.items()))


def write_config(
    views: StampedViews, folder: Path, settings: Mapping[str, Mapping[str, Any]] | None = None
) -> tuple[Path, str]:
    """Write the configuration of a site on free ports; return its path and the site's address.

    `settings`, by section, override the defaults.
    """
    bus, http = f"tcp/127.0.0.1:{free_port()}", free_port()
    content: dict[str, Any] = {
        "site": views.site,
        "cameras": views.cameras,
        "ground": str(views.ground),
        "sync": {**SETTINGS["sync"], "port": free_port()},
        "zenoh": {"connect": bus, "listen": bus},
        "http": {"port": http},
        "record": {**SETTINGS["record"], "folder": str(folder / "kept")},
    }
    for section, values in (settings or {}).items():
        content[section] = {**content.get(section, {}), **values}
    config = folder / "site.yaml"
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    return config, f"http://127.0.0.1:{http}/"


@contextlib.asynccontextmanager
async def run_separately(
    views: StampedViews,
    folder: Path,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    environments: Mapping[str, Mapping[str, str]] | None = None,
) -> AsyncIterator[FaultSite]:
    """Run a site's processes separately, with variables by process name; terminate them at the end."""
    config, url = write_config(views, folder, settings)
    with (folder / "site.log").open("w", encoding="utf-8") as log:
        control = SeparateProcesses(config, log, environments)
        fault_site = FaultSite(url, folder, 0, control=control, recorded=folder / "kept")
        try:
            for name in NAMES:
                await control.start(name)
            async with follow_events(fault_site):
                yield fault_site
        finally:
            fault_site.exits += await control.terminate()


def restart_processes(*processes: str) -> Inject:
    """Terminate processes, and restart each as soon as it has exited."""

    async def restart(fault_site: FaultSite, name: str) -> None:
        fault_site.exits.append(await terminate_process(name, fault_site.control.processes[name]))
        await fault_site.control.start(name)

    async def inject(fault_site: FaultSite) -> None:
        await asyncio.gather(*(restart(fault_site, name) for name in names(fault_site, processes)))

    return inject


def _restart(processes: tuple[str, ...]) -> Fault:
    name, inject = f"restart {title(processes)}", restart_processes(*processes)
    if BESTVIEW in processes:
        return Fault(name, run_separately, inject, 15.0, None, kills_server=True)
    return Fault(name, run_separately, inject)


# A render worker is terminated only by the best view, its parent.
FAULTS = (
    *map(_restart, process_sets(BESTVIEW, RENDERING)),
    *map(_restart, (processes for processes in process_sets(RENDERING) if BESTVIEW in processes)),
)
