"""``/metrics``: the service's metrics, and those of HTTP: viewers, traffic, wrong tokens, event loop lag."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable

from aiohttp import web
from prometheus_client import CollectorRegistry, Metric, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.registry import Collector

from server.http.access.authorization import ACCESS
from server.http.api.events import EVENTS
from server.http.app_keys import ON_DISK, SERVICE
from server.http.metrics.event_loop_lag import LoopLag
from server.http.viewers.hls_sessions import HLS_SESSIONS
from server.http.viewers.traffic import TRAFFIC

METRICS = web.AppKey("metrics", CollectorRegistry)

routes = web.RouteTableDef()


@routes.get("/metrics")
async def get_metrics(request: web.Request) -> web.Response:
    """Return the metrics in Prometheus' text format."""
    metrics: CollectorRegistry = request.app[METRICS]
    return web.Response(body=generate_latest(metrics), headers={"Content-Type": "text/plain; version=0.0.4"})


class HttpCollector(Collector):
    """Collects the metrics of the HTTP application."""

    def __init__(self, app: web.Application, lag: LoopLag) -> None:
        self._app, self._lag = app, lag

    def collect(self) -> Iterable[Metric]:
        """Return all metrics as they are now."""
        app, traffic = self._app, self._app[TRAFFIC]
        yield from self._viewers()
        yield CounterMetricFamily(
            "myview_wrong_tokens",
            "Requests with an unknown or revoked token.",
            value=app[ACCESS].authenticator.wrong_tokens,
        )
        yield GaugeMetricFamily(
            "myview_config_differs",
            "1: the configuration file is not what runs: invalid, not reloaded, or waiting for a restart.",
            value=float(app[ON_DISK]().differs),
        )
        yield from self._lag.histogram.collect()
        size = CounterMetricFamily("myview_sent_bytes", "Bytes sent over HTTP.", labels=["of"])
        size.add_metric(["streams"], traffic.streams)
        size.add_metric(["answers"], traffic.answers)
        yield size
        yield CounterMetricFamily(
            "myview_viewers_lost_gops",
            "GOPs that viewers lost because they fell behind.",
            value=traffic.lost_gops,
        )

    def _viewers(self) -> Iterable[Metric]:
        service, sessions = self._app[SERVICE], self._app[HLS_SESSIONS]
        connected, past = service.streams.connected_viewers, service.recordings.viewers
        yield GaugeMetricFamily(
            "myview_viewers", "Streams being watched.", value=connected.total + past + sessions.all
        )
        kinds = {
            "object": connected.object,
            "camera": connected.camera,
            "preferred": connected.preferred,
            "hls": sessions.all,
            "past": past,
            "pictures": service.rendering.viewers,
            "events": self._app[EVENTS].viewers,
        }
        family = GaugeMetricFamily("myview_viewers_by_kind", "Connected viewers by kind.", labels=["kind"])
        for kind, count in kinds.items():
            family.add_metric([kind], count)
        yield family


def register_metrics(app: web.Application) -> None:
    """Register all metrics with an application, after its other parts."""
    lag, registry = LoopLag(), CollectorRegistry()
    app[METRICS] = registry
    app[SERVICE].register_metrics(registry, queues={"viewer": lambda: app[TRAFFIC].longest_queue})
    registry.register(HttpCollector(app, lag))

    async def measure_lag(_: web.Application) -> AsyncIterator[None]:
        task = asyncio.create_task(lag.run(), name="lag")
        yield
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    app.cleanup_ctx.append(measure_lag)
