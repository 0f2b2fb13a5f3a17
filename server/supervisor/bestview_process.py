"""The best-view service's process; no codec is loaded in it."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path

from camsync import SyncError
from server.config.running_config import ActiveConfig
from server.http.app import make_app, serving
from server.service.pipeline import BestViewPipeline
from server.service.service import BestViewService
from server.supervisor.exposure_checks import check_bus, check_viewers
from server.supervisor.sighup import reloads
from server.supervisor.startup_signal import signal_started
from server.supervisor.synthetic_homographies import add_synthetic_homographies
from server.system.errors import UnavailableError, UserError

log = logging.getLogger(__name__)


async def bestview_process(running: ActiveConfig, out: Path | None = None) -> None:
    """Run the best-view service with its page, streams and API.

    Raises:
        UserError: a port or the output folder is unavailable, or the site is exposed by accident.
        UnavailableError: the connection to the pulse server is lost.
    """
    config = running.now
    check_viewers(config)
    check_bus(config)
    pipeline = BestViewPipeline(add_synthetic_homographies(config), out)
    reload_task = asyncio.create_task(_follow(running, pipeline), name="reload")
    try:
        pipeline.open_bus()
        async with serving(make_app(BestViewService(pipeline), running.on_disk), config.http) as port:
            scheme = "http" if config.http.tls.key is None else "https"
            log.info("page, streams and API on %s://%s:%d/", scheme, config.http.host, port)
            signal_started()
            await pipeline.run()
    except SyncError as error:
        raise UnavailableError(f"bestview: {error}") from error
    finally:
        reload_task.cancel()
        pipeline.close()


async def _follow(running: ActiveConfig, pipeline: BestViewPipeline) -> None:
    """Apply the settings of reloaded configurations that a running service can change."""
    async for reload in reloads(running):
        try:
            pipeline.apply_config(reload.now)
        except UserError as error:
            log.warning("%s: %s; the previous configuration stays in force", running.path, error)
        except Exception:
            log.exception("%s: applying the configuration failed; the next reload tries again", running.path)
        else:
            running.now = reload.now
            log.info("%s", reload.line)
