"""Prometheus metrics of the cameras: what arrives, how long each stage takes, what is lost where."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from prometheus_client import Metric
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.registry import Collector

from server.messaging.camera_status import CONDITION_TEXTS, CameraStatus
from server.service.ingest.camera_state import CameraState
from server.service.metrics.camera_metrics import RecentSeconds
from server.service.pipeline import BestViewPipeline

Value = Callable[[str, CameraState], float | None]
"""Returns a value by a camera's id and state; None: unknown."""


class CameraCollector(Collector):
    """Collects what the cameras' messages report."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline = pipeline

    def collect(self) -> Iterable[Metric]:
        """Return all metrics as they are now."""
        yield from self._cameras()
        yield self._stages()
        yield self._gauge("fps", "Frames captured per second.", _of_status(lambda status: status.fps))
        yield self._gauge(
            "synchronized",
            "Pulses come from the server; otherwise the camera counts by itself.",
            _of_status(lambda status: float(status.synchronized)),
        )
        offsets = self._pipeline.joint.offsets
        yield self._gauge(
            "floor_offset_meters",
            "Meters by which the camera disagrees with the others about where people stand.",
            lambda camera, _: offsets.get(camera),
        )
        yield self._gauge(
            "waiting_frames", "Frames that wait for detection.", _of_status(lambda status: status.waiting)
        )
        yield self._gauge(
            "load_level",
            "Load-shedding level of the camera; 0: none.",
            _of_status(lambda status: status.load_level),
        )
        yield self._gauge(
            "covered_share",
            "Share of the picture that something on the lens hides.",
            _of_status(lambda status: status.covered_share),
        )
        for name, description, spread in _SPREADS:
            yield self._spread(name, description, spread)
        late, lost = self._pipeline.aligner.late_messages, self._pipeline.loss_recorder.lost_frames
        yield self._counter(
            "late_windows", "Windows that arrived too late to count.", lambda camera, _: late[camera]
        )
        yield self._counter(
            "lost_frames", "Frames missing when their GOP was decided.", lambda camera, _: lost[camera]
        )
        yield self._counter(
            "stream_changes",
            "Changes of what the camera sends after which it was opened again.",
            lambda _, state: state.stream_changes,
        )
        yield self._counter("windows", "Windows solved.", lambda _, state: state.metrics.totals.windows)
        yield self._counter(
            "optimal_windows",
            "Windows whose solution is proven optimal.",
            lambda _, state: state.metrics.totals.optimal,
        )
        yield self._counter(
            "position_corrections",
            "Position corrections that the tracker received since its start.",
            _of_status(lambda status: status.position_corrections),
        )
        yield self._counter(
            "corrected_windows",
            "Windows that revised final frames after an operator's correction.",
            lambda _, state: state.metrics.totals.corrected,
        )
        yield self._counter(
            "gap", "Sum of the gaps of all other windows.", lambda _, state: state.metrics.totals.gap
        )

    def _cameras(self) -> Iterable[Metric]:
        live = GaugeMetricFamily("myview_camera_live", "The camera delivers frames.", labels=["camera"])
        frames = CounterMetricFamily("myview_camera_frames", "Frames received.", labels=["camera"])
        missed = CounterMetricFamily("myview_camera_missed", "Pulses without a frame.", labels=["camera"])
        shed = CounterMetricFamily("myview_camera_shed", "Frames without detection.", labels=["camera"])
        without_peers = CounterMetricFamily(
            "myview_camera_without_peers",
            "Frames tracked without another camera's detections.",
            labels=["camera"],
        )
        bad = CounterMetricFamily(
            "myview_camera_bad_messages",
            "Invalid messages that the camera has sent or received.",
            labels=["camera", "direction"],
        )
        offset = GaugeMetricFamily(
            "myview_camera_clock_offset_seconds",
            "Pulse server's clock minus the camera's.",
            labels=["camera"],
        )
        condition = GaugeMetricFamily(
            "myview_camera_condition", "1: this is wrong with the picture.", labels=["camera", "condition"]
        )
        limited = CounterMetricFamily(
            "myview_camera_limited_windows",
            "Windows whose solver was stopped by a limit of work or time.",
            labels=["camera", "limit"],
        )
        retry = GaugeMetricFamily(
            "myview_camera_retry_seconds",
            "Until a source that cannot be used is opened again.",
            labels=["camera", "cause"],
        )
        for camera, state in self._pipeline.ingest.states.items():
            if state.unavailable is not None:
                retry.add_metric([camera, state.unavailable.cause], state.unavailable.retry_s)
            for limit, count in state.metrics.totals.limited.items():
                limited.add_metric([camera, limit], count)
            labels = [camera]
            live.add_metric(labels, float(state.label == "live"))
            frames.add_metric(labels, state.frames)
            without_peers.add_metric(labels, state.frames_without_peers)
            bad.add_metric([camera, "sent"], state.bad_messages)
            if state.status is not None:
                missed.add_metric(labels, state.status.missed)
                shed.add_metric(labels, state.status.shed)
                bad.add_metric([camera, "received"], state.status.bad_messages)
                offset.add_metric(labels, state.status.clock_offset)
                for name in CONDITION_TEXTS:
                    condition.add_metric([camera, name], float(name == state.status.condition))
        return [live, frames, missed, shed, without_peers, bad, offset, limited, condition, retry]

    def _stages(self) -> Metric:
        family = HistogramMetricFamily(
            "myview_stage_seconds", "How long a camera's stage took.", labels=["camera", "stage"]
        )
        for camera, state in self._pipeline.ingest.states.items():
            for stage, histogram in state.metrics.totals.stages.items():
                samples = [sample for metric in histogram.collect() for sample in metric.samples]
                buckets = [
                    (sample.labels["le"], sample.value)
                    for sample in samples
                    if sample.name.endswith("_bucket")
                ]
                seconds = next(sample.value for sample in samples if sample.name.endswith("_sum"))
                family.add_metric([camera, stage], buckets, seconds)
        return family

    def _spread(
        self, name: str, description: str, of: Callable[[CameraState], RecentSeconds | None]
    ) -> Metric:
        family = GaugeMetricFamily(
            f"myview_camera_{name}_seconds", description, labels=["camera", "statistic"]
        )
        for camera, state in self._pipeline.ingest.states.items():
            spread = of(state)
            if spread is not None:
                family.add_metric([camera, "median"], spread.median)
                family.add_metric([camera, "worst"], spread.worst)
        return family

    def _gauge(self, name: str, description: str, value: Value) -> Metric:
        return self._filled(GaugeMetricFamily(f"myview_camera_{name}", description, labels=["camera"]), value)

    def _counter(self, name: str, description: str, value: Value) -> Metric:
        return self._filled(
            CounterMetricFamily(f"myview_camera_{name}", description, labels=["camera"]), value
        )

    def _filled(self, family: GaugeMetricFamily | CounterMetricFamily, value: Value) -> Metric:
        for camera, state in self._pipeline.ingest.states.items():
            number = value(camera, state)
            if number is not None:
                family.add_metric([camera], number)
        return family


def _of_status(value: Callable[[CameraStatus], float]) -> Value:
    return lambda _, state: None if state.status is None else value(state.status)


_SPREADS: tuple[tuple[str, str, Callable[[CameraState], RecentSeconds | None]], ...] = (
    ("sync_error", "From a pulse to the capture of its frame.", lambda state: state.metrics.sync_error),
    (
        "tracking_delay",
        "From the pulse of a window's last frame to its solution.",
        lambda state: state.metrics.tracking_delay,
    ),
)
