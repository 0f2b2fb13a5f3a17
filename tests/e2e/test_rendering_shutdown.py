"""A site's render workers exit with it, whatever they are doing."""

from __future__ import annotations

import asyncio
import signal
import time
from pathlib import Path

import aiohttp
import pytest

from fakes.running.site import configuration, running, with_timeout

pytestmark = [pytest.mark.live, pytest.mark.slow]

EXIT_S = 2.0


async def test_render_workers_exit_within_two_seconds_of_sigterm(tmp_path: Path) -> None:
    cameras = [{"id": "c0", "source": "scene:room?camera=0&cameras=1&objects=2&seed=1"}]
    site = {"name": "drawn", "fps": 25, "width": 320, "height": 180}
    config = configuration(tmp_path, tmp_path, site=site, cameras=cameras, ground=None)
    async with running(config) as started:
        await started.until(lambda: len(started.gops) > 2, "decisions arrive")
        async with (
            aiohttp.ClientSession(started.url) as session,
            session.get("/cameras/c0/live.mjpeg") as plain,
            session.get("/cameras/c0/live.mjpeg?overlay=1") as boxed,
        ):
            for answer in (plain, boxed):
                assert answer.status == 200
                await with_timeout(answer.content.readexactly(10_000))
            workers = processes("server.service.rendering.worker", started.children()["bestview"])
            assert len(workers) == 2
            started.process.send_signal(signal.SIGTERM)
            terminated_at = time.monotonic()
            while any(Path(f"/proc/{pid}").exists() for pid in workers):
                await asyncio.sleep(0.01)
                assert time.monotonic() < terminated_at + EXIT_S
            assert await started.wait_for_exit() == 0


def processes(module: str, parent: int) -> list[int]:
    """Return the pids of a process's children that run a module."""
    children = Path(f"/proc/{parent}/task").glob("*/children")
    pids = [int(pid) for path in children for pid in path.read_text().split()]
    return [pid for pid in pids if module in Path(f"/proc/{pid}/cmdline").read_text().split("\0")]
