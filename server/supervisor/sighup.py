"""SIGHUP: reload the configuration, or exit if the terminal was closed."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import sys
import termios
from collections.abc import AsyncGenerator, AsyncIterator, Callable

from server.config.running_config import ActiveConfig
from server.config.site_config import Config
from server.supervisor.reload import ReloadPlan, plan_reload
from server.system.errors import UserError

log = logging.getLogger(__name__)

Check = Callable[[Config, ReloadPlan], None]
"""Checks whether a new configuration can be applied; raises UserError if not."""

_early: list[int] = []
"""Signals received before :func:`sighups` runs."""


def record_early_sighups() -> None:
    """Record each SIGHUP until :func:`sighups` runs; only in the main thread.

    Called before the configuration is read, so that changes while the process starts are reloaded.
    """
    signal.signal(signal.SIGHUP, lambda number, _: _early.append(number))


async def sighups() -> AsyncGenerator[None, None]:
    """Yield once per SIGHUP; signals that arrive meanwhile count as one.

    If the terminal was closed, send this process SIGTERM instead.
    """
    received = asyncio.Event()
    at_terminal = _has_terminal()
    asyncio.get_running_loop().add_signal_handler(signal.SIGHUP, received.set)
    if _early:  # only now: later signals set the event themselves
        _early.clear()
        received.set()
    while True:
        await received.wait()
        received.clear()
        if at_terminal and not _has_terminal():
            _discard_errors()
            os.kill(os.getpid(), signal.SIGTERM)
        else:
            yield


async def reloads(running: ActiveConfig, check: Check = lambda *_: None) -> AsyncIterator[ReloadPlan]:
    """Reload the configuration at each SIGHUP; yield the reload plan.

    An invalid configuration is logged in one line and ignored. The caller sets ``running.now`` once it has
    applied the changes.
    """
    async for _ in sighups():
        try:
            reload = await asyncio.to_thread(_read, running, check)
        except UserError as error:
            log.warning("%s; the previous configuration stays in force", error)
        except Exception:
            log.exception("reloading the configuration failed; the previous one stays in force")
        else:
            yield reload


def _read(running: ActiveConfig, check: Check) -> ReloadPlan:
    wanted = running.read_config_to_activate()
    reload = plan_reload(running.now, wanted)
    check(wanted, reload)
    return reload


def _has_terminal() -> bool:
    """Return whether standard error is an open terminal."""
    try:
        termios.tcgetattr(sys.stderr.fileno())
    except (termios.error, OSError, ValueError):
        return False
    return True


def _discard_errors() -> None:
    """Let standard error lead nowhere: lines for a closed terminal would make the exit code 120."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
