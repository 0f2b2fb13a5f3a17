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
from server.messaging.camera_status import RetryCause
from server.supervisor.reload import ReloadPlan
from server.supervisor.sighup import reloads
from server.supervisor.startup_checks import check_source_opens
from server.supervisor.startup_signal import signal_started
from server.supervisor.synthetic_homographies import add_joint_homographies
from server.supervisor.unavailability import UnavailabilityReport
from server.system.errors import UnavailableError, UserError

log = logging.getLogger(__name__)

_RETRY_FIRST_S, _RETRY_MAX_S = 0.5, 10.0
_STABLE_S = 10.0
"""Running time after which a camera is opened again with the shortest delay."""


async def camera_process(running: ActiveConfig, camera_id: str) -> None:
    """Run one camera; restart it when a reload changes its settings.

    Waits for a network camera or device that does not answer yet, and, once the site has started, for any
    source that cannot be opened or used. Meanwhile the best-view service is told why, and until when.

    Raises:
        UserError: its source cannot be opened.
        UnavailableError: the connection to the pulse server is lost.
    """
    if source_kind(running.now.camera(camera_id).source) is SourceKind.STREAM:
        signal_started()  # opening it mostly waits for a network or device, so others may start meanwhile
    restart = asyncio.Event()
    reload_task = asyncio.create_task(_follow(running, camera_id, restart), name="reload")
    attempts = _Attempts(running, camera_id, restart)
    try:
        camera = await _create(running, camera_id, attempts, started=False)
        signal_started()
        while not await _run(camera, attempts):
            camera = await _create(running, camera_id, attempts, started=True)
    except SyncError as error:
        raise UnavailableError(f"camera {camera_id}: {error}") from error
    finally:
        reload_task.cancel()
        attempts.close()
        await asyncio.gather(reload_task, return_exceptions=True)


class _Attempts:
    """Spaces the attempts to use a camera, reports those that fail, and throttles their log lines.

    A camera may also be opened each time and fail soon after. ``restart`` is set when the settings change.
    """

    def __init__(self, running: ActiveConfig, camera_id: str, restart: asyncio.Event) -> None:
        self._running, self._id, self.restart = running, camera_id, restart
        self._report = UnavailabilityReport(camera_id)
        self._failures, self._reopenings = LogThrottle(quiet_s=0.0), LogThrottle()
        self._backoff = Backoff(_RETRY_FIRST_S, _RETRY_MAX_S)

    async def failed(self, error: UserError) -> None:
        """Record that the camera cannot be opened, and wait before the next attempt."""
        if (more := self._failures.record(str(error))) is not None:
            log.warning("%s%s; retrying", error, more)
        await self._wait(error, "unopened")

    def opened(self) -> None:
        """Record that it has been opened."""
        self.close()
        if ended := self._failures.end():
            log.info("camera %s is available, after %.0f s", self._id, ended.seconds)

    async def must_reopen(self, error: UnavailableError, ran_s: float) -> None:
        """Record that it must be opened again after some seconds, and wait before that."""
        if ran_s >= _STABLE_S:
            self._backoff.reset()
        if (more := self._reopenings.record(str(error))) is not None:
            log.warning("camera %s: %s%s; opening it again", self._id, error, more)
        await self._wait(error, "changed")

    def settings_changed(self) -> None:
        """Begin with the shortest delay again: other settings may be right."""
        self._backoff.reset()

    def close(self) -> None:
        """Stop reporting."""
        self._report.close()

    async def _wait(self, error: UserError, cause: RetryCause) -> None:
        pause_s = self._backoff.next()
        self._report.send(self._running.now, str(error), cause, pause_s)
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self.restart.wait(), pause_s)
            self.settings_changed()


async def _create(
    running: ActiveConfig, camera_id: str, attempts: _Attempts, *, started: bool
) -> CameraProcess:
    """Create the camera when its source can be opened, with the active settings.

    The process keeps running meanwhile: a new one would load all libraries again. ``started``: the site has
    started, so an error of this camera must not end it.
    """
    while True:
        attempts.restart.clear()
        try:
            camera = await asyncio.to_thread(_open, running.now, camera_id)
        except UserError as error:
            if not (started or isinstance(error, UnavailableError)):
                raise
            started = True
            await attempts.failed(error)
        else:
            attempts.opened()
            return camera


def _open(config: Config, camera_id: str) -> CameraProcess:
    return CameraProcess(fill_in_password(add_joint_homographies(config), camera_id), camera_id)


async def _run(camera: CameraProcess, attempts: _Attempts) -> bool:
    """Run until the recording is over (return True) or the camera has to be opened again (return False)."""
    loop = asyncio.get_running_loop()
    began = loop.time()
    run, waiting = asyncio.create_task(camera.run()), asyncio.create_task(attempts.restart.wait())
    try:
        await asyncio.wait({run, waiting}, return_when=asyncio.FIRST_COMPLETED)
        if run.done():
            run.result()
        else:
            attempts.settings_changed()
        return run.done()
    except UnavailableError as error:  # what the camera sends has changed
        await attempts.must_reopen(error, loop.time() - began)
        return False
    finally:
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
