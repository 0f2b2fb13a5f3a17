"""SIGHUP: reload the configuration, or end if the terminal was closed."""

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
"""Looks whether what is wanted can be; raises UserError where it cannot."""

_early: list[int] = []
"""The signals that came before anybody waited for them."""


def record_early_sighups() -> None:
    """Record each SIGHUP from now on, for :func:`sighups`; only in the main thread.

    Called before the configuration is read: what is written while the process starts is then read again.
    """
    signal.signal(signal.SIGHUP, lambda number, _: _early.append(number))


async def sighups() -> AsyncGenerator[None, None]:
    """Return a turn for each time that SIGHUP has come; those that come meanwhile are one.

    When it came because the terminal was closed, the process is told to end instead.
    """
    came = asyncio.Event()
    at_terminal = _has_terminal()
    asyncio.get_running_loop().add_signal_handler(signal.SIGHUP, came.set)
    if _early:  # only now: what comes from here on sets it by itself
        _early.clear()
        came.set()
    while True:
        await came.wait()
        came.clear()
        if at_terminal and not _has_terminal():
            os.kill(os.getpid(), signal.SIGTERM)
        else:
            yield


async def reloads(running: ActiveConfig, check: Check = lambda *_: None) -> AsyncIterator[ReloadPlan]:
    """Read the configuration again whenever SIGHUP comes, and give what it changes.

    What is wrong is said in one line, and leaves in force what is. Whoever is given a change sets
    ``running.now`` once it is in force.
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
    wanted = running.wanted()
    reload = plan_reload(running.now, wanted)
    check(wanted, reload)
    return reload


def _has_terminal() -> bool:
    """Return whether what is said goes to a terminal that is there."""
    try:
        termios.tcgetattr(sys.stderr.fileno())
    except (termios.error, OSError, ValueError):
        return False
    return True
