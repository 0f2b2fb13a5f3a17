"""What the HTTP application carries along for its handlers."""

from __future__ import annotations

from collections.abc import Callable

from aiohttp import web
from prometheus_client import CollectorRegistry

from server.view.pictures import Pictures
from server.view.service import BestViewService
from server.web.events import Events
from server.web.readers import Readers
from server.wire.running import OnDisk

SERVICE = web.AppKey("service", BestViewService)
EVENTS = web.AppKey("events", Events)
READERS = web.AppKey("readers", Readers)
PICTURES = web.AppKey("pictures", Pictures)
ON_DISK: web.AppKey[Callable[[], OnDisk]] = web.AppKey("on disk")
METRICS = web.AppKey("metrics", CollectorRegistry)
