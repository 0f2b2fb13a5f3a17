"""One camera's process."""

from __future__ import annotations

import asyncio
import contextlib
import logging

from camsync import SyncError
from expbackoff import Backoff
from logthrottle import LogThrottle
from server.camera.process import CameraProcess
from server.config.camera_password import fill_in_password
from server.config.running_config import ActiveConfig
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.supervisor.reload import ReloadPlan
from server.supervisor.sighup import reloads
from server.supervisor.startup_checks import check_recording
from server.supervisor.startup_signal import signal_started
from server.system.errors import UnavailableError, UserError

log = logging.getLogger(__name__)

_RETRY_FIRST_S, _RETRY_MAX_S = 0.5, 10.0


async def camera_process(running: ActiveConfig, camera_id: str) -> None:
    """Run one camera; restart it when a reload changes its settings.

    Waits for a network camera or device that does not answer yet.

    Raises:
        UserError: its source cannot be opened.
        UnavailableError: the pulses are lost for good, or the restart failed.
    """
    if source_kind(running.now.camera(camera_id).source) is SourceKind.STREAM:
        signal_started()  # opening it mostly waits for a network or a device, without load
    restart = asyncio.Event()
    following = asyncio.create_task(_follow(running, camera_id, restart), name="reload")
    try:
        camera = await _create(running, camera_id, restart, begun=False)
        signal_started()
        while not await _run(camera, restart):
            camera = await _create(running, camera_id, restart, begun=True)
    except SyncError as error:
        raise UnavailableError(f"camera {camera_id}: {error}") from error
    finally:
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)


async def _create(
    running: ActiveConfig, camera_id: str, restart: asyncio.Event, *, begun: bool
) -> CameraProcess:
    """Create the camera as soon as its source opens, by the settings in force; ``restart``: they changed.

    Ending the process instead would load all libraries again each time. ``begun``: the site has started, so
    errors of this camera end it alone.
    """
    away, backoff = LogThrottle(quiet_s=0.0), Backoff(_RETRY_FIRST_S, _RETRY_MAX_S)
    while True:
        restart.clear()
        try:
            camera = await asyncio.to_thread(_open, running.now, camera_id)
        except UnavailableError as error:
            if (more := away.record(str(error))) is not None:
                log.warning("%s%s; retrying", error, more)
            begun = True
        except UserError as error:
            if not begun:
                raise
            raise UnavailableError(str(error)) from error  # the supervisor restarts this process
        else:
            if ended := away.end():
                log.info("camera %s answers, after %.0f s", camera_id, ended.seconds)
            return camera
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(restart.wait(), backoff.next())


def _open(config: Config, camera_id: str) -> CameraProcess:
    return CameraProcess(fill_in_password(config, camera_id), camera_id)


async def _run(camera: CameraProcess, restart: asyncio.Event) -> bool:
    """Run until the recording is over (True) or the camera has to restart (False)."""
    run, waiting = asyncio.create_task(camera.run()), asyncio.create_task(restart.wait())
    try:
        await asyncio.wait({run, waiting}, return_when=asyncio.FIRST_COMPLETED)
        if run.done():
            run.result()
        return run.done()
    finally:
        restart.clear()
        for task in (run, waiting):
            task.cancel()
        await asyncio.gather(run, waiting, return_exceptions=True)


async def _follow(running: ActiveConfig, camera_id: str, restart: asyncio.Event) -> None:
    def check(_: Config, reload: ReloadPlan) -> None:
        if camera_id in reload.cameras:
            check_recording(reload.now, camera_id)

    async for reload in reloads(running, check):
        running.now = reload.now
        if camera_id in reload.cameras:
            log.info("configuration reloaded: this camera restarts")
            restart.set()
        else:
            log.info("configuration reloaded: this camera is unchanged")
