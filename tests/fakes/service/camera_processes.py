"""Cameras and a best-view service over a real bus and real pulses, in one event loop."""

from __future__ import annotations

import asyncio
from pathlib import Path

from camsync import PulseServer, ServerLimits
from fakes.timeouts import PATIENCE
from server.camera.process import CameraProcess
from server.config.pulse_access import bestview_client_name, pulse_users
from server.config.site_config import Config
from server.service.pipeline import BestViewPipeline

FPS = 50


class SiteInOneLoop:
    """A whole site in this event loop: pulses, cameras, best view."""

    def __init__(self, config: Config, out: Path | None = None) -> None:
        self.config = config
        self.service = BestViewPipeline(config, out)
        self._tasks: list[asyncio.Task[None]] = []
        expect = {*config.camera_ids, bestview_client_name(0)}
        self.pulses = PulseServer(
            FPS,
            expect=expect,
            start_timeout=PATIENCE,
            port=config.sync.port,
            users=pulse_users(config),
            limits=ServerLimits(catch_up=PATIENCE),  # a machine that stalls must not skip pulses here
        )

    def camera(self, camera: str) -> asyncio.Task[None]:
        task = asyncio.create_task(self._run(camera))
        self._tasks.append(task)
        return task

    async def _run(self, camera: str) -> None:
        # In a thread: opening a recording takes time, and the pulses run in this loop.
        process = await asyncio.to_thread(CameraProcess, self.config, camera)
        await process.run()

    async def start(self) -> asyncio.Task[None]:
        await self.pulses.start()
        self.service.open_bus()
        task = asyncio.create_task(self.service.run())
        self._tasks.append(task)
        return task

    async def stop(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self.service.close()
        await self.pulses.stop()


def written_files(folder: Path) -> dict[str, bytes]:
    """Return the written files of tracks and choices."""
    files = [*folder.rglob("*.txt"), *folder.rglob("*.csv")]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}
