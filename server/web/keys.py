"""What the HTTP application carries along for its handlers."""

from __future__ import annotations

from aiohttp import web
from prometheus_client import CollectorRegistry

from server.view.service import BestViewService
from server.web.events import Events

SERVICE = web.AppKey("service", BestViewService)
EVENTS = web.AppKey("events", Events)
METRICS = web.AppKey("metrics", CollectorRegistry)
