"""Keys of what the HTTP application provides to all handlers."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from aiohttp import web

from server.config.running_config import ConfigFileState
from server.service.service import BestViewService
from server.setup.session import SetupSession

SERVICE = web.AppKey("service", BestViewService)


@dataclass(frozen=True, slots=True)
class SiteControl:
    """What an operator may do to the whole site.

    Attributes:
        path: the configuration file; None: it is not known.
        restart: set to start all processes again; None: nothing supervises them.
        reload: applies what the configuration file says now, as far as that needs no restart, soon after it
            returns; None: it is not known how.
        refused: why the last restart went back to the earlier configuration; empty: it did not.
    """

    path: Path | None = None
    restart: asyncio.Event | None = None
    reload: Callable[[], None] | None = None
    refused: str = ""


CONTROL = web.AppKey("control", SiteControl)
SETUP = web.AppKey("setup", SetupSession)
ON_DISK: web.AppKey[Callable[[], ConfigFileState]] = web.AppKey("on disk")
"""Returns how the configuration file differs from the configuration in force."""
