"""``myview up``: a whole site on one machine, with its supervisor and reloads."""

from __future__ import annotations

import asyncio
import errno
import logging
import tempfile
from collections.abc import Mapping
from pathlib import Path

from logthrottle import LogThrottle
from server.config.running_config import (
    ACTIVE_CONFIG_VARIABLE,
    ActiveConfig,
    serialize_with_absolute_paths,
)
from server.config.site_config import Config
from server.supervisor.exposure_checks import check_bus, check_pulses, check_rtsp, check_viewers
from server.supervisor.reload import ReloadPlan
from server.supervisor.sighup import reloads
from server.supervisor.startup_checks import check_source_opens, check_sources_open
from server.supervisor.startup_signal import REFUSAL_VARIABLE, REFUSED_RESTART_VARIABLE
from server.supervisor.supervisor import Supervisor
from server.system.errors import UserError, reason_of
from server.system.private_files import is_owned_by_this_user

log = logging.getLogger(__name__)

_RESTART_INTERVAL_S = 4.0
"""Seconds between two camera restarts, during which other cameras show the people of the restarting one."""


async def run_up(running: ActiveConfig, environment: Mapping[str, str], out: Path | None) -> None:
    """Run a site until the best-view service has nothing left to do, or this task is cancelled.

    When an operator wants it, all processes start again, with the file's configuration. If one of them
    refuses that, they start once more with the earlier one.

    Raises:
        UserError: a process refused its input.
    """
    with _folder() as folder:
        site, earlier = SiteProcesses(running, Path(folder), environment), None
        while True:
            try:
                if not await site.run(out, has_run=running.now == earlier):
                    return
            except UserError as error:
                if earlier is None:
                    raise
                site.refused = site.read_refusal() or str(error)
                log.warning("%s; all processes start again with the previous configuration", site.refused)
                running.now = earlier
            else:
                earlier = running.now
                site.refused = await _read_again(running)
                log.info("all processes start again")
            out = None  # its folder belongs to the first run


async def _read_again(running: ActiveConfig) -> str:
    """Activate the file's configuration; if it cannot be used, return why, and change nothing."""
    try:
        wanted = await asyncio.to_thread(running.read_config_to_activate)
        check_exposure(wanted)
        await asyncio.to_thread(check_sources_open, wanted)
    except UserError as error:
        log.warning("%s; the previous configuration stays in force", error)
        return str(error)
    running.now = wanted
    return ""


class SiteProcesses:
    """The processes of a site, which may be started several times.

    ``folder`` is private: cameras have passwords. ``refused`` says why the last restart went back to the
    earlier configuration; empty: it did not.
    """

    def __init__(self, running: ActiveConfig, folder: Path, environment: Mapping[str, str]) -> None:
        self._running, self._environment = running, environment
        self._active_file, self._refusal_file = folder / "site.yaml", folder / "refusal"
        self._write_failures = LogThrottle()
        self.refused = ""

    async def run(self, out: Path | None, *, has_run: bool) -> bool:
        """Run all processes until the site ends; return whether it is to start again.

        Raises:
            UserError: a process refused its input, and the site never ``has_run`` with this configuration.
        """
        self._refusal_file.unlink(missing_ok=True)
        variables = {
            ACTIVE_CONFIG_VARIABLE: str(self._active_file),
            REFUSAL_VARIABLE: str(self._refusal_file),
            REFUSED_RESTART_VARIABLE: self.refused,
        }
        # Rewritten before each start: old temporary files may be deleted while a site runs for months.
        supervisor = Supervisor(
            self._running.path,
            self._running.now,
            {**self._environment, **variables},
            out,
            before_start=self.write_active_config,
            has_run=has_run,
        )
        reload_task = asyncio.create_task(self._follow(supervisor), name="reload")
        try:
            await supervisor.run()
        finally:
            reload_task.cancel()
            await asyncio.gather(reload_task, return_exceptions=True)
        return supervisor.restart_wanted

    def read_refusal(self) -> str:
        """Return why a process refused to start; empty: it is not known."""
        try:
            return " ".join(self._refusal_file.read_text(encoding="utf-8").split())
        except OSError:
            return ""

    async def _follow(self, supervisor: Supervisor) -> None:
        """Send SIGHUP to the processes whose settings have changed, at each reload."""
        async for reload in reloads(self._running, _check):
            log.info("%s", reload.line)
            self._running.now = reload.now
            self.write_active_config()
            supervisor.reload("bestview")
            if reload.gateway:
                supervisor.reload("rtsp")
            for number, camera in enumerate(reload.cameras):
                if number:
                    await asyncio.sleep(_RESTART_INTERVAL_S)
                supervisor.reload(camera)

    def write_active_config(self) -> None:
        """Write the configuration in force, atomically, for processes that start."""
        path, config = self._active_file, self._running
        new = path.with_suffix(".new")
        try:
            path.parent.mkdir(mode=0o700, exist_ok=True)
            if not is_owned_by_this_user(path.parent):  # it was deleted, and another user has created it
                raise PermissionError(errno.EACCES, "its folder belongs to another user")
            new.write_text(serialize_with_absolute_paths(config.now, config.path.parent), encoding="utf-8")
            new.replace(path)
        except OSError as error:
            if (more := self._write_failures.record(reason_of(error))) is not None:
                log.warning("%s: cannot write the running configuration: %s%s", path, reason_of(error), more)


def check_exposure(config: Config) -> None:
    """Refuse a site that other machines can reach without authentication.

    Raises:
        UserError: they can.
    """
    for check in (check_viewers, check_pulses, check_bus):
        check(config)
    if config.rtsp.enabled:
        check_rtsp(config)


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
