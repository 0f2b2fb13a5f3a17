"""A full disk while a site records and writes decisions: a small tmpfs in its own mount namespace."""

from __future__ import annotations

import asyncio
import contextlib
import os
import shutil
import sys
from collections.abc import AsyncIterator
from pathlib import Path

from benchmarks.common.environment import CannotRunError, one_thread_environment
from benchmarks.faults.injection.separate_processes import write_config
from benchmarks.faults.site.fault_site import Fault, FaultSite, follow_events, terminate_process
from benchmarks.faults.video.stamped_views import StampedViews

_MB = 48
_FULL_S = 6.0
_MOUNTED = 'mount -t tmpfs -o size="$1" none "$2" && shift 2 && exec "$@"'
_CHUNK = 1 << 20
_DECISIONS = "decided"


@contextlib.asynccontextmanager
async def with_small_disk(views: StampedViews, folder: Path) -> AsyncIterator[FaultSite]:
    """Run `myview up` with recordings and decision files on a small disk.

    Raises:
        CannotRunError: a small disk cannot be mounted.
    """
    unshare = shutil.which("unshare")
    if unshare is None or os.geteuid():
        raise CannotRunError("a small disk needs unshare (util-linux), and the right to mount")
    config, url = await asyncio.to_thread(write_config, views, folder)
    recordings = folder / "kept"
    await asyncio.to_thread(recordings.mkdir)
    command = [
        sys.executable,
        "-m",
        "server.cli.main",
        "up",
        str(config),
        "--out",
        str(recordings / _DECISIONS),
    ]
    with (folder / "up.log").open("w", encoding="utf-8") as log:
        process = await asyncio.create_subprocess_exec(
            *(unshare, "-m", "sh", "-c", _MOUNTED, "sh", f"{_MB}m", str(recordings), *command),
            env=one_thread_environment(),
            stdout=log,
            stderr=log,
        )
    disk: int | None = None
    try:
        fault_site = FaultSite(url, folder, process.pid)
        async with follow_events(fault_site):
            disk = os.open(f"/proc/{process.pid}/root{recordings}", os.O_RDONLY | os.O_DIRECTORY)
            fault_site.recorded = Path(f"/proc/self/fd/{disk}")  # valid as long as this is open
            yield fault_site
            fault_site.exits.append(await terminate_process("up", process))
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


async def fill_disk(fault_site: FaultSite) -> None:
    """Fill the disk, and free it again after a while."""
    filler = fault_site.recorded / "filler"
    await asyncio.to_thread(_fill, filler)
    await asyncio.sleep(_FULL_S)
    await asyncio.to_thread(filler.unlink)


def _fill(path: Path) -> None:
    with contextlib.suppress(OSError), path.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(_CHUNK))


FAULTS = (Fault("disk full", with_small_disk, fill_disk, 20.0, stops_recording=True),)
