"""The site as containers are run: each process for itself, told to end and started again."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import IO, Any

import yaml

from benchmarks.common.environment import one_thread_environment
from benchmarks.faults.injection.process_pairs import BESTVIEW, DRAWING, names, title, turns
from benchmarks.faults.site.fault_site import SETTINGS, Fault, FaultSite, Inject, listening, told_to_end
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews
from server.cli.generated_config import free_port

NAMES = ("bestview", "sync", *CAMERAS)


class SeparateProcesses:
    """Processes that are started one by one; ``own`` is what the environment of each says besides."""

    def __init__(
        self, config: Path, log: IO[str], own: Mapping[str, Mapping[str, str]] | None = None
    ) -> None:
        self._config, self._log, self._own = config, log, own or {}
        self.processes: dict[str, asyncio.subprocess.Process] = {}

    async def start(self, name: str) -> None:
        """Start a process."""
        words = ["camera", str(self._config), name] if name in CAMERAS else [name, str(self._config)]
        self.processes[name] = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "server.cli.main", *words),
            env={**one_thread_environment(), "MYVIEW_SUPERVISED": "1", **self._own.get(name, {})},
            stdout=self._log,
            stderr=self._log,
        )


def configured(
    views: StampedViews, folder: Path, settings: Mapping[str, Mapping[str, Any]] | None = None
) -> tuple[Path, str]:
    """Write the configuration of a site on free ports; give it, and the site's address.

    `settings`, by section, are set besides.
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
async def apart(
    views: StampedViews,
    folder: Path,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    own: Mapping[str, Mapping[str, str]] | None = None,
) -> AsyncIterator[FaultSite]:
    """Run a site's processes one by one, each with an environment of its own; in the end tell them to end."""
    config, url = configured(views, folder, settings)
    with (folder / "site.log").open("w", encoding="utf-8") as log:
        control = SeparateProcesses(config, log, own)
        stand = FaultSite(url, folder, 0, control=control, recorded=folder / "kept")
        try:
            for name in NAMES:
                await control.start(name)
            async with listening(stand):
                yield stand
        finally:
            stand.ended += await asyncio.gather(
                *(told_to_end(name, it) for name, it in control.processes.items() if it.returncode is None)
            )


def restarted(*processes: str) -> Inject:
    """Stop processes, and restart each as soon as it has exited."""

    async def restart(stand: FaultSite, name: str) -> None:
        stand.ended.append(await told_to_end(name, stand.control.processes[name]))
        await stand.control.start(name)

    async def inject(stand: FaultSite) -> None:
        await asyncio.gather(*(restart(stand, name) for name in names(stand, processes)))

    return inject


def _restart(processes: tuple[str, ...]) -> Fault:
    name, inject = f"restart {title(processes)}", restarted(*processes)
    if BESTVIEW in processes:
        return Fault(name, apart, inject, 15.0, None, breaks=True)
    return Fault(name, apart, inject)


# A drawing process is told to end by nobody but the best view, whose child it is.
FAULTS = (
    *map(_restart, turns(BESTVIEW, DRAWING)),
    *map(_restart, (it for it in turns(DRAWING) if BESTVIEW in it)),
)
