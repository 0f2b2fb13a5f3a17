"""Keys of what the HTTP application provides to all handlers."""

from __future__ import annotations

from collections.abc import Callable

from aiohttp import web

from server.config.running_config import ConfigFileState
from server.service.service import BestViewService

SERVICE = web.AppKey("service", BestViewService)
ON_DISK: web.AppKey[Callable[[], ConfigFileState]] = web.AppKey("on disk")
"""Returns how the configuration file differs from the configuration in force."""
