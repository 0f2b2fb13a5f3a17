"""Prometheus metrics of the service: decisions, queues, streams, recording, rendering."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from prometheus_client import CollectorRegistry, Metric, ProcessCollector, disable_created_metrics
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.registry import Collector

from server.service.metrics.camera_collector import CameraCollector
from server.service.readiness import why_not_ready

if TYPE_CHECKING:
    from server.service.pipeline import BestViewPipeline
    from server.service.rendering.render_pool import RenderPool


class ServiceCollector(Collector):
    """Collects what the pipeline counts and measures."""

    def __init__(self, pipeline: BestViewPipeline, queues: Mapping[str, Callable[[], int]]) -> None:
        self._pipeline, self._more_queues = pipeline, queues

    def collect(self) -> Iterable[Metric]:
        """Return all metrics as they are now."""
        pipeline, stages = self._pipeline, self._pipeline.stage_timers
        yield GaugeMetricFamily("myview_pulse", "Newest pulse.", value=pipeline.pulses.newest)
        yield GaugeMetricFamily(
            "myview_objects", "People known.", value=len(pipeline.decision_state.selected_views)
        )
        yield CounterMetricFamily("myview_cuts", "Changes of view.", value=pipeline.decision_state.cuts)
        yield CounterMetricFamily(
            "myview_late_epochs",
            "Windows of connected cameras that arrived too late for their epoch.",
            value=pipeline.loss_recorder.late_epochs,
        )
        yield CounterMetricFamily(
            "myview_left_out_epochs",
            "Epochs skipped because decisions had fallen too far behind.",
            value=pipeline.skipped_epochs,
        )
        yield GaugeMetricFamily(
            "myview_ready", "A best view can be served now.", value=float(not why_not_ready(pipeline))
        )
        yield GaugeMetricFamily(
            "myview_decided_pulse",
            "First pulse that is not decided yet.",
            value=pipeline.decision_state.end,
        )
        for histogram in (stages.track, stages.decide, stages.send, stages.delay):
            yield from histogram.collect()
        yield from self._queues()
        yield from self._flags()
        yield from self._recording()
        yield from self._replication()

    def _queues(self) -> Iterable[Metric]:
        pipeline, writer = self._pipeline, self._pipeline.recorder.writer
        waiting = GaugeMetricFamily("myview_waiting", "Items waiting, by queue.", labels=["queue"])
        waiting.add_metric(["messages"], sum(inbox.waiting for inbox in pipeline.bus.inboxes))
        waiting.add_metric(["windows"], pipeline.aligner.waiting_windows)
        waiting.add_metric(["recording"], writer.queued if writer else 0)
        for queue, length in self._more_queues.items():
            waiting.add_metric([queue], length())
        yield waiting
        yield CounterMetricFamily(
            "myview_lost_messages",
            "Bus messages lost because they arrived faster than they could be handled.",
            value=sum(inbox.lost for inbox in pipeline.bus.inboxes),
        )

    def _flags(self) -> Iterable[Metric]:
        assist = self._pipeline.assist
        flags = CounterMetricFamily("myview_flags", "Flags for the operator.", labels=["state"])
        for state, count in assist.flags.counts.items():
            flags.add_metric([state], count)
        yield flags
        yield GaugeMetricFamily(
            "myview_flags_open", "Flags that can be answered now.", value=len(assist.flags.open)
        )
        yield CounterMetricFamily(
            "myview_position_corrections",
            "Position corrections sent to cameras.",
            value=assist.corrections_sent,
        )

    def _recording(self) -> Iterable[Metric]:
        recorder = self._pipeline.recorder
        size, writer = recorder.folder.bytes if recorder.folder else 0, recorder.writer
        is_recording = writer is not None and not writer.problem
        yield GaugeMetricFamily("myview_recording", "Streams are being recorded.", value=float(is_recording))
        yield GaugeMetricFamily("myview_recorded_bytes", "Bytes of the recording on the disk.", value=size)
        yield CounterMetricFamily(
            "myview_recorded_gops", "GOPs recorded.", value=writer.written if writer else 0
        )
        yield CounterMetricFamily(
            "myview_unrecorded_gops",
            "GOPs that could not be recorded.",
            value=writer.lost if writer else 0,
        )

    def _replication(self) -> Iterable[Metric]:
        replication = self._pipeline.replication
        yield GaugeMetricFamily(
            "myview_leads", "The site's other services follow this one.", value=float(replication.leads)
        )
        yield CounterMetricFamily(
            "myview_followed_records",
            "Records of the leading service whose numbers replaced this one's.",
            value=replication.followed,
        )
        heard = GaugeMetricFamily(
            "myview_linked_site_up", "Another site is heard and accepted.", labels=["site"]
        )
        sites = self._pipeline.other_sites
        for name, site in sorted(sites.sites.items()):
            heard.add_metric([name], float(site.is_there(sites.now)))
        yield heard


class RenderingCollector(Collector):
    """Collects the metrics of rendered streams."""

    def __init__(self, rendering: RenderPool) -> None:
        self._rendering = rendering

    def collect(self) -> Iterable[Metric]:
        """Return all metrics as they are now."""
        rendering = self._rendering
        yield GaugeMetricFamily(
            "myview_pictures", "People and cameras rendered now.", value=len(rendering.streams)
        )
        yield GaugeMetricFamily(
            "myview_pictures_viewers", "Viewers of rendered streams.", value=rendering.viewers
        )
        yield CounterMetricFamily(
            "myview_pictures_restarts", "Render workers that died.", value=rendering.restarts
        )
        yield CounterMetricFamily(
            "myview_pictures_lost_gops", "GOPs that arrived too fast to be rendered.", value=rendering.lost
        )


def register_collectors(
    registry: CollectorRegistry,
    pipeline: BestViewPipeline,
    rendering: RenderPool,
    queues: Mapping[str, Callable[[], int]],
) -> None:
    """Register all collectors of a service and its process; ``queues`` are further queue lengths, by name."""
    disable_created_metrics()  # type: ignore[no-untyped-call]
    registry.register(ServiceCollector(pipeline, queues))
    registry.register(CameraCollector(pipeline))
    registry.register(RenderingCollector(rendering))
    ProcessCollector(registry=registry)
