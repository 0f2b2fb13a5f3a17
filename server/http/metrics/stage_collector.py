"""``/metrics`` of the service's own stages: deciding, sending, queues, viewers, the event loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable

from aiohttp import web
from prometheus_client import Metric
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.registry import Collector

from server.http.app_keys import EVENTS, METRICS, PICTURES, READERS, SERVICE
from server.http.event_loop_lag import Lag
from server.http.metrics.camera_collector import CameraStages
from server.http.traffic import SENT, Sent
from server.service.metrics.histogram import Histogram
from server.service.readiness import why_not_ready


class ServiceStages(Collector):
    """Gives the numbers of what the service does with windows, GOPs and viewers."""

    def __init__(self, app: web.Application, lag: Lag) -> None:
        self._app, self._lag = app, lag

    def collect(self) -> Iterable[Metric]:
        """Give all metrics as they are now."""
        service, sent = self._app[SERVICE], self._app[SENT]
        stages = service.stages
        yield GaugeMetricFamily(
            "myview_ready", "A best view can be served now.", value=float(not why_not_ready(service))
        )
        yield GaugeMetricFamily(
            "myview_decided_pulse", "First pulse that nothing is decided about.", value=service.board.end
        )
        yield _histogram("myview_decide_seconds", "Deciding one epoch.", stages.decide)
        yield _histogram("myview_send_seconds", "Telling and sending one GOP.", stages.send)
        yield _histogram("myview_delay_seconds", "From a GOP's first pulse to its being sent.", stages.delay)
        yield _histogram("myview_loop_lag_seconds", "How late the event loop is.", self._lag.histogram)
        yield from self._queues()
        yield self._viewers()
        size = CounterMetricFamily("myview_sent_bytes", "Bytes sent over HTTP.", labels=["of"])
        size.add_metric(["streams"], sent.streams)
        size.add_metric(["answers"], sent.answers)
        yield size
        yield CounterMetricFamily(
            "myview_viewers_lost_gops", "GOPs that viewers lost because they fell behind.", value=sent.lost
        )

    def _queues(self) -> Iterable[Metric]:
        service, writer = self._app[SERVICE], self._app[SERVICE].past.writer
        waiting = GaugeMetricFamily("myview_waiting", "What waits, by queue.", labels=["queue"])
        waiting.add_metric(["messages"], sum(inbox.waiting for inbox in service.inboxes))
        waiting.add_metric(["windows"], service.aligner.waiting)
        waiting.add_metric(["recording"], writer.waiting if writer else 0)
        waiting.add_metric(["viewer"], self._app[SENT].longest)
        yield waiting
        yield CounterMetricFamily(
            "myview_lost_messages",
            "Messages of the bus that came faster than they could be read.",
            value=sum(inbox.lost for inbox in service.inboxes),
        )

    def _viewers(self) -> Metric:
        service = self._app[SERVICE]
        splicer = service.splicer
        kinds = {
            "object": splicer.person_viewers,
            "camera": sum(
                it.viewers for it in (*splicer.cameras.values(), *splicer.decided_cameras.values())
            ),
            "preferred": splicer.preferred_camera_viewers,
            "hls": self._app[READERS].all,
            "past": service.past.viewers,
            "pictures": self._app[PICTURES].viewers,
            "events": self._app[EVENTS].viewers,
        }
        family = GaugeMetricFamily("myview_viewers_by_kind", "Who is connected, by kind.", labels=["kind"])
        for kind, count in kinds.items():
            family.add_metric([kind], count)
        return family


def measure(app: web.Application) -> None:
    """Add what is measured of every stage to an application's metrics."""
    lag = Lag()
    app[SENT] = Sent()
    app[METRICS].register(CameraStages(app[SERVICE]))
    app[METRICS].register(ServiceStages(app, lag))
    app.on_response_prepare.append(app[SENT].count)

    async def lagging(_: web.Application) -> AsyncIterator[None]:
        task = asyncio.create_task(lag.run(), name="lag")
        yield
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    app.cleanup_ctx.append(lagging)


def _histogram(name: str, words: str, of: Histogram) -> Metric:
    return HistogramMetricFamily(name, words, buckets=of.buckets, sum_value=of.sum)
