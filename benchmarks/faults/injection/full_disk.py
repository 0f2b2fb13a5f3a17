"""A disk that is full while a site records and writes decisions: in memory, seen by its processes only."""

from __future__ import annotations

import asyncio
import contextlib
import os
import shutil
import sys
from collections.abc import AsyncIterator
from pathlib import Path

from benchmarks.common.environment import CannotRunError, one_thread_environment
from benchmarks.faults.injection.separate_processes import configured
from benchmarks.faults.site.fault_site import Fault, FaultSite, listening, told_to_end
from benchmarks.faults.video.stamped_views import StampedViews

_MB = 48
_FULL_S = 6.0
_MOUNTED = 'mount -t tmpfs -o size="$1" none "$2" && shift 2 && exec "$@"'
_CHUNK = 1 << 20
_DECIDED = "decided"


@contextlib.asynccontextmanager
async def on_small_disk(views: StampedViews, folder: Path) -> AsyncIterator[FaultSite]:
    """Run `myview up`, which records onto a small disk, and writes what it decides there, too.

    Raises:
        CannotRunError: such a disk cannot be mounted here.
    """
    unshare = shutil.which("unshare")
    if unshare is None or os.geteuid():
        raise CannotRunError("a small disk needs unshare (util-linux), and the right to mount")
    config, url = await asyncio.to_thread(configured, views, folder)
    kept = folder / "kept"
    await asyncio.to_thread(kept.mkdir)
    command = [sys.executable, "-m", "server.cli.main", "up", str(config), "--out", str(kept / _DECIDED)]
    with (folder / "up.log").open("w", encoding="utf-8") as log:
        process = await asyncio.create_subprocess_exec(
            *(unshare, "-m", "sh", "-c", _MOUNTED, "sh", f"{_MB}m", str(kept), *command),
            env=one_thread_environment(),
            stdout=log,
            stderr=log,
        )
    disk: int | None = None
    try:
        stand = FaultSite(url, folder, process.pid)
        async with listening(stand):
            disk = os.open(f"/proc/{process.pid}/root{kept}", os.O_RDONLY | os.O_DIRECTORY)
            stand.recorded = Path(f"/proc/self/fd/{disk}")  # it is there as long as this is open
            yield stand
            stand.ended.append(await told_to_end("up", process))
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


async def full(stand: FaultSite) -> None:
    """Fill the disk, and make room again after a while."""
    filler = stand.recorded / "filler"
    await asyncio.to_thread(_fill, filler)
    await asyncio.sleep(_FULL_S)
    await asyncio.to_thread(filler.unlink)


def _fill(path: Path) -> None:
    with contextlib.suppress(OSError), path.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(_CHUNK))


FAULTS = (Fault("disk full", on_small_disk, full, 20.0, unrecorded=True),)
