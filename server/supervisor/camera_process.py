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
from server.supervisor.startup_checks import check_source_opens
from server.supervisor.startup_signal import signal_started
from server.supervisor.synthetic_homographies import add_joint_homographies
from server.supervisor.unavailability import UnavailabilityReport
from server.system.errors import UnavailableError, UserError

log = logging.getLogger(__name__)

_RETRY_FIRST_S, _RETRY_MAX_S = 0.5, 10.0


async def camera_process(running: ActiveConfig, camera_id: str) -> None:
    """Run one camera; restart it when a reload changes its settings.

    Waits for a network camera or device that does not answer yet, and, once the site has started, for any
    source that cannot be opened or used. Meanwhile the best-view service is told why.

    Raises:
        UserError: its source cannot be opened.
        UnavailableError: the connection to the pulse server is lost.
    """
    if source_kind(running.now.camera(camera_id).source) is SourceKind.STREAM:
        signal_started()  # opening it mostly waits for a network or device, so others may start meanwhile
    restart = asyncio.Event()
    reload_task = asyncio.create_task(_follow(running, camera_id, restart), name="reload")
    try:
        camera = await _create(running, camera_id, restart, started=False)
        signal_started()
        while not await _run(camera, camera_id, restart):
            camera = await _create(running, camera_id, restart, started=True)
    except SyncError as error:
        raise UnavailableError(f"camera {camera_id}: {error}") from error
    finally:
        reload_task.cancel()
        await asyncio.gather(reload_task, return_exceptions=True)


async def _create(
    running: ActiveConfig, camera_id: str, restart: asyncio.Event, *, started: bool
) -> CameraProcess:
    """Create the camera when its source can be opened, with the active settings.

    The process keeps running meanwhile: a new one would load all libraries again. ``restart`` is set when the
    settings change. ``started``: the site has started, so an error of this camera must not end it.
    """
    failures, backoff = LogThrottle(quiet_s=0.0), Backoff(_RETRY_FIRST_S, _RETRY_MAX_S)
    with contextlib.closing(UnavailabilityReport(running.now, camera_id)) as report:
        while True:
            restart.clear()
            try:
                camera = await asyncio.to_thread(_open, running.now, camera_id)
            except UserError as error:
                if not (started or isinstance(error, UnavailableError)):
                    raise
                if (more := failures.record(str(error))) is not None:
                    log.warning("%s%s; retrying", error, more)
                report.send(str(error))
                started = True
            else:
                if ended := failures.end():
                    log.info("camera %s is available, after %.0f s", camera_id, ended.seconds)
                return camera
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(restart.wait(), backoff.next())


def _open(config: Config, camera_id: str) -> CameraProcess:
    return CameraProcess(fill_in_password(add_joint_homographies(config), camera_id), camera_id)


async def _run(camera: CameraProcess, camera_id: str, restart: asyncio.Event) -> bool:
    """Run until the recording is over (return True) or the camera has to be opened again (return False)."""
    run, waiting = asyncio.create_task(camera.run()), asyncio.create_task(restart.wait())
    try:
        await asyncio.wait({run, waiting}, return_when=asyncio.FIRST_COMPLETED)
        if run.done():
            run.result()
        return run.done()
    except UnavailableError as error:  # what the camera sends has changed
        log.warning("camera %s: %s; opening it again", camera_id, error)
        return False
    finally:
        restart.clear()
        for task in (run, waiting):
            task.cancel()
        await asyncio.gather(run, waiting, return_exceptions=True)


async def _follow(running: ActiveConfig, camera_id: str, restart: asyncio.Event) -> None:
    def check(_: Config, reload: ReloadPlan) -> None:
        if camera_id in reload.cameras:
            check_source_opens(reload.now, camera_id)

    async for reload in reloads(running, check):
        running.now = reload.now
        if camera_id in reload.cameras:
            log.info("configuration reloaded: this camera restarts")
            restart.set()
        else:
            log.info("configuration reloaded: this camera is unchanged")
