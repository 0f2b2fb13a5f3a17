"""The best-view service's process; no codec is loaded in it, except by WebRTC."""

from __future__ import annotations

import asyncio
import gc
import logging
import os
import signal
from collections.abc import Callable
from pathlib import Path

from camsync import SyncError
from server.config.running_config import ACTIVE_CONFIG_VARIABLE, ActiveConfig
from server.http.app import make_app, serving
from server.http.app_keys import SiteControl
from server.integrations.integrations import integrating
from server.service.pipeline import BestViewPipeline
from server.service.service import BestViewService
from server.supervisor.exposure_checks import check_bus, check_viewers
from server.supervisor.shutdown import EXIT_RESTART, is_supervised
from server.supervisor.sighup import reloads
from server.supervisor.startup_signal import REFUSED_RESTART_VARIABLE, signal_started
from server.supervisor.synthetic_homographies import add_synthetic_homographies
from server.system.errors import UnavailableError, UserError


class RestartError(UserError):
    """All processes of the site are to start again; the supervisor does so."""

    code = EXIT_RESTART


log = logging.getLogger(__name__)


_GARBAGE_OBJECTS = 50_000
"""Allocations beyond deallocations after which cycles are looked for; Python's default is 700."""


def collect_garbage_rarely() -> None:
    """Look for cycles more rarely: with a hundred cameras it takes a fifth of the service's time."""
    gc.set_threshold(_GARBAGE_OBJECTS)


async def bestview_process(running: ActiveConfig, out: Path | None = None) -> None:
    """Run the best-view service with its page, streams and API.

    Raises:
        UserError: a port or the output folder is unavailable, or the site is exposed by accident.
        UnavailableError: the connection to the pulse server is lost.
    """
    collect_garbage_rarely()
    config = running.now
    check_viewers(config)
    check_bus(config)
    pipeline = BestViewPipeline(add_synthetic_homographies(config).of_service(), out)
    reload = reloader()
    reload_task = asyncio.create_task(_follow(running, pipeline), name="reload")
    try:
        pipeline.open_bus()
        restart = asyncio.Event() if is_supervised() else None
        refused = os.environ.get(REFUSED_RESTART_VARIABLE, "")
        control = SiteControl(running.path, restart, reload, refused)
        service = BestViewService(pipeline)
        app = make_app(service, running.on_disk, control)
        async with integrating(service), serving(app, config.http) as port:
            scheme = "http" if config.http.tls.key is None else "https"
            log.info("page, streams and API on %s://%s:%d/", scheme, config.http.host, port)
            signal_started()
            await _run_until_restart(pipeline, control.restart)
    except SyncError as error:
        raise UnavailableError(f"bestview: {error}") from error
    finally:
        reload_task.cancel()
        pipeline.close()


def reloader() -> Callable[[], None]:
    """Return a function that reloads the site's configuration file, as SIGHUP does.

    Under `myview up` that is for the supervisor to do, which keeps the configuration in force for processes
    that it starts again. If it has died, nothing happens: this process is about to end.
    """
    own, parent = os.getpid(), os.getppid()
    if ACTIVE_CONFIG_VARIABLE not in os.environ:
        return lambda: os.kill(own, signal.SIGHUP)

    def reload() -> None:
        if os.getppid() == parent:
            os.kill(parent, signal.SIGHUP)

    return reload


async def _run_until_restart(pipeline: BestViewPipeline, restart: asyncio.Event | None) -> None:
    """Run the service until it has nothing left to do.

    Raises:
        RestartError: an operator wants all processes to start again.
    """
    run = asyncio.create_task(pipeline.run(), name="service")
    wanted = asyncio.create_task((restart or asyncio.Event()).wait(), name="restart")
    try:
        await asyncio.wait({run, wanted}, return_when=asyncio.FIRST_COMPLETED)
        if run.done():
            run.result()
            return
        raise RestartError("an operator restarts the site")
    finally:
        for task in (run, wanted):
            task.cancel()
        await asyncio.gather(run, wanted, return_exceptions=True)


async def _follow(running: ActiveConfig, pipeline: BestViewPipeline) -> None:
    """Apply the settings of reloaded configurations that a running service can change."""
    async for reload in reloads(running):
        try:
            pipeline.apply_config(reload.now.of_service())
        except UserError as error:
            log.warning("%s: %s; the previous configuration stays in force", running.path, error)
        except Exception:
            log.exception("%s: applying the configuration failed; the next reload tries again", running.path)
        else:
            running.now = reload.now
            log.info("%s", reload.line)
