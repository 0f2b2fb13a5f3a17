"""``myview up``: a whole site on one machine, with its supervisor and reloads."""

from __future__ import annotations

import asyncio
import errno
import logging
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from logthrottle import LogThrottle
from server.config.running_config import (
    ACTIVE_CONFIG_VARIABLE,
    ActiveConfig,
    is_owned_by_this_user,
    serialize_with_absolute_paths,
)
from server.config.site_config import Config
from server.supervisor.exposure_checks import check_bus, check_pulses, check_rtsp, check_viewers
from server.supervisor.reload import ReloadPlan
from server.supervisor.sighup import reloads
from server.supervisor.startup_checks import check_source_opens, check_sources_open
from server.supervisor.supervisor import Supervisor
from server.system.errors import UserError, reason_of

log = logging.getLogger(__name__)

_RESTART_INTERVAL_S = 4.0
"""Seconds between two camera restarts, during which other cameras show the people of the restarting one."""


async def run_up(running: ActiveConfig, environment: Mapping[str, str], out: Path | None) -> None:
    """Run a site until the best-view service has nothing left to do, or this task is cancelled.

    When an operator wants it, all processes start again, with the file's configuration.

    Raises:
        UserError: a process refused its input.
    """
    while await _run_once(running, environment, out):
        try:
            wanted = await asyncio.to_thread(running.read_config_to_activate)
            check_exposure(wanted)
            await asyncio.to_thread(check_sources_open, wanted)
        except UserError as error:
            log.warning("%s; the previous configuration stays in force", error)
        else:
            running.now = wanted
        out = None  # its folder belongs to the first run
        log.info("all processes start again")


async def _run_once(running: ActiveConfig, environment: Mapping[str, str], out: Path | None) -> bool:
    """Run all processes until the site ends; return whether it is to start again."""
    with _folder() as folder:
        active_file, write_failures = Path(folder) / "site.yaml", LogThrottle()
        # Rewritten before each start: old temporary files may be deleted while a site runs for months.
        supervisor = Supervisor(
            running.path,
            running.now,
            {**environment, ACTIVE_CONFIG_VARIABLE: str(active_file)},
            out,
            before_start=lambda: _write_active_config(running, active_file, write_failures),
        )
        reload_task = asyncio.create_task(
            _follow(running, supervisor, lambda: _write_active_config(running, active_file, write_failures)),
            name="reload",
        )
        try:
            await supervisor.run()
        finally:
            reload_task.cancel()
            await asyncio.gather(reload_task, return_exceptions=True)
        return supervisor.restart_wanted


def check_exposure(config: Config) -> None:
    """Refuse a site that other machines can reach without authentication.

    Raises:
        UserError: they can.
    """
    for check in (check_viewers, check_pulses, check_bus):
        check(config)
    if config.rtsp.enabled:
        check_rtsp(config)


async def _follow(running: ActiveConfig, supervisor: Supervisor, write_config: Callable[[], None]) -> None:
    """Send SIGHUP to the processes whose settings have changed, at each reload."""
    async for reload in reloads(running, _check):
        log.info("%s", reload.line)
        running.now = reload.now
        write_config()
        supervisor.reload("bestview")
        if reload.gateway:
            supervisor.reload("rtsp")
        for number, camera in enumerate(reload.cameras):
            if number:
                await asyncio.sleep(_RESTART_INTERVAL_S)
            supervisor.reload(camera)


def _folder() -> tempfile.TemporaryDirectory[str]:
    """Make a private folder: cameras have passwords.

    Raises:
        UserError: it cannot be made.
    """
    try:
        return tempfile.TemporaryDirectory(prefix="myview-up-")
    except OSError as error:
        reason = reason_of(error)
        raise UserError(f"cannot make a temporary folder (TMPDIR names where): {reason}") from error


def _check(wanted: Config, reload: ReloadPlan) -> None:
    check_exposure(wanted)
    for camera in reload.cameras:
        check_source_opens(reload.now, camera)


def _write_active_config(running: ActiveConfig, path: Path, failures: LogThrottle) -> None:
    """Write the configuration in force, atomically, for processes that start."""
    new = path.with_suffix(".new")
    try:
        path.parent.mkdir(mode=0o700, exist_ok=True)
        if not is_owned_by_this_user(path.parent):  # it was deleted, and another user has created it
            raise PermissionError(errno.EACCES, "its folder belongs to another user")
        new.write_text(serialize_with_absolute_paths(running.now, running.path.parent), encoding="utf-8")
        new.replace(path)
    except OSError as error:
        if (more := failures.record(reason_of(error))) is not None:
            log.warning("%s: cannot write the running configuration: %s%s", path, reason_of(error), more)
