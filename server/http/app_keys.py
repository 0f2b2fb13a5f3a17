"""What the HTTP application carries along for its handlers."""

from __future__ import annotations

from collections.abc import Callable

from aiohttp import web
from prometheus_client import CollectorRegistry

from server.config.running_config import ConfigFileState
from server.http.api.events import Events
from server.http.hls.sessions import Readers
from server.service.rendering.render_pool import RenderPool
from server.service.service import BestViewService

SERVICE = web.AppKey("service", BestViewService)
EVENTS = web.AppKey("events", Events)
READERS = web.AppKey("readers", Readers)
PICTURES = web.AppKey("pictures", RenderPool)
ON_DISK: web.AppKey[Callable[[], ConfigFileState]] = web.AppKey("on disk")
METRICS = web.AppKey("metrics", CollectorRegistry)
