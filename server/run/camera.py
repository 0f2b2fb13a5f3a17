"""One camera's process."""

from __future__ import annotations

import asyncio
import logging

from camsync import SyncError
from server.camera.process import CameraProcess
from server.run.checks import check_recording
from server.run.hang_up import reloads
from server.run.reload import Reload
from server.wire.camera_password import with_password
from server.wire.config import Config
from server.wire.errors import AwayError, UserError
from server.wire.running import Running

log = logging.getLogger(__name__)


async def camera_process(running: Running, camera_id: str) -> None:
    """Run one camera; when a configuration that is read again changes what it goes by, it begins anew.

    Raises:
        UserError: its source cannot be opened.
        AwayError: it lost the pulses for good, or cannot begin anew.
    """
    anew = asyncio.Event()
    following = asyncio.create_task(_follow(running, camera_id, anew), name="reload")
    try:
        camera = await asyncio.to_thread(_made, running.now, camera_id)
        while not await _run(camera, anew):
            try:
                camera = await asyncio.to_thread(
                    CameraProcess, with_password(running.now, camera_id), camera_id
                )
            except UserError as error:  # whoever looks after this process starts it again
                raise AwayError(str(error)) from error
    except SyncError as error:
        raise AwayError(f"camera {camera_id}: {error}") from error
    finally:
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)


def _made(config: Config, camera_id: str) -> CameraProcess:
    return CameraProcess(with_password(config, camera_id), camera_id)


async def _run(camera: CameraProcess, anew: asyncio.Event) -> bool:
    """Run until the recording is over, which is said, or until the camera has to begin anew."""
    run, waiting = asyncio.create_task(camera.run()), asyncio.create_task(anew.wait())
    try:
        await asyncio.wait({run, waiting}, return_when=asyncio.FIRST_COMPLETED)
        if run.done():
            run.result()
        return run.done()
    finally:
        anew.clear()
        for task in (run, waiting):
            task.cancel()
        await asyncio.gather(run, waiting, return_exceptions=True)


async def _follow(running: Running, camera_id: str, anew: asyncio.Event) -> None:
    def check(_: Config, reload: Reload) -> None:
        if camera_id in reload.cameras:
            check_recording(reload.now, camera_id)

    async for reload in reloads(running, check):
        running.now = reload.now
        if camera_id in reload.cameras:
            log.info("the configuration was read again, and changes this camera: it begins anew")
            anew.set()
        else:
            log.info("the configuration was read again: nothing in it changes this camera while it runs")
