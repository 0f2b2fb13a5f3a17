"""Prometheus metrics of the cameras: what arrives, how long each stage takes, what is lost where."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from prometheus_client import Metric
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.registry import Collector

from server.messaging.messages import CameraStatus
from server.service.ingest.ingest import CameraState
from server.service.metrics.camera_metrics import RecentSeconds
from server.service.pipeline import BestViewPipeline

Value = Callable[[str, CameraState], float | None]
"""A camera's number by its id and state; None: it is not known."""


class CameraCollector(Collector):
    """Collects what the cameras' messages report."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline = pipeline

    def collect(self) -> Iterable[Metric]:
        """Return all metrics as they are now."""
        yield from self._cameras()
        yield self._stages()
        yield self._gauge("fps", "Frames taken a second.", _of_status(lambda it: it.fps))
        yield self._gauge(
            "synchronized",
            "Pulses come from the server: the camera does not count by itself.",
            _of_status(lambda it: float(it.synchronized)),
        )
        yield self._gauge(
            "waiting_frames", "Frames that wait to be searched.", _of_status(lambda it: it.waiting)
        )
        yield self._gauge(
            "load_level",
            "How much is left out because the machine has too much to do; 0: nothing.",
            _of_status(lambda it: it.load_level),
        )
        for what, words, spread in _SPREADS:
            yield self._spread(what, words, spread)
        late, lost = self._pipeline.aligner.late_messages, self._pipeline.loss_recorder.lost_pictures
        yield self._counter("late_windows", "Windows that came too late to count.", lambda it, _: late[it])
        yield self._counter(
            "lost_pictures", "Pictures not there when their GOP was decided.", lambda it, _: lost[it]
        )
        yield self._counter("windows", "Windows solved.", lambda _, it: it.metrics.totals.windows)
        yield self._counter(
            "certified_windows",
            "Windows whose answer is proven to be the best there is.",
            lambda _, it: it.metrics.totals.certified,
        )
        yield self._counter(
            "position_corrections",
            "Places that an operator pointed at and the tracker was given, since its start.",
            _of_status(lambda it: it.position_corrections),
        )
        yield self._counter(
            "corrected_windows",
            "Windows that have changed what was final, by where an operator pointed.",
            lambda _, it: it.metrics.totals.corrected,
        )
        yield self._counter(
            "gap", "Sum of the gaps of all other windows.", lambda _, it: it.metrics.totals.gap
        )

    def _cameras(self) -> Iterable[Metric]:
        live = GaugeMetricFamily("myview_camera_live", "The camera delivers frames.", labels=["camera"])
        frames = CounterMetricFamily("myview_camera_frames", "Frames received.", labels=["camera"])
        missed = CounterMetricFamily("myview_camera_missed", "Pulses without a frame.", labels=["camera"])
        shed = CounterMetricFamily("myview_camera_shed", "Frames not searched for people.", labels=["camera"])
        unheard = CounterMetricFamily(
            "myview_camera_without_peers",
            "Frames in which people were followed without what some other camera found.",
            labels=["camera"],
        )
        bad = CounterMetricFamily(
            "myview_camera_bad_messages",
            "Messages not understood: those that the camera has sent, and those that it has received.",
            labels=["camera", "direction"],
        )
        offset = GaugeMetricFamily(
            "myview_camera_clock_offset_seconds",
            "Pulse server's clock minus the camera's.",
            labels=["camera"],
        )
        for camera, state in self._pipeline.ingest.states.items():
            labels = [camera]
            live.add_metric(labels, float(state.label == "live"))
            frames.add_metric(labels, state.frames)
            unheard.add_metric(labels, state.frames_without_peers)
            bad.add_metric([camera, "sent"], state.bad_messages)
            if state.status is not None:
                missed.add_metric(labels, state.status.missed)
                shed.add_metric(labels, state.status.shed)
                bad.add_metric([camera, "received"], state.status.bad_messages)
                offset.add_metric(labels, state.status.clock_offset)
        return [live, frames, missed, shed, unheard, bad, offset]

    def _stages(self) -> Metric:
        family = HistogramMetricFamily(
            "myview_stage_seconds", "How long a camera's stage took.", labels=["camera", "stage"]
        )
        for camera, state in self._pipeline.ingest.states.items():
            for stage, took in state.metrics.totals.stages.items():
                samples = [sample for metric in took.collect() for sample in metric.samples]
                buckets = [(it.labels["le"], it.value) for it in samples if it.name.endswith("_bucket")]
                seconds = next(it.value for it in samples if it.name.endswith("_sum"))
                family.add_metric([camera, stage], buckets, seconds)
        return family

    def _spread(self, what: str, words: str, of: Callable[[CameraState], RecentSeconds | None]) -> Metric:
        family = GaugeMetricFamily(f"myview_camera_{what}_seconds", words, labels=["camera", "statistic"])
        for camera, state in self._pipeline.ingest.states.items():
            spread = of(state)
            if spread is not None:
                family.add_metric([camera, "median"], spread.median)
                family.add_metric([camera, "worst"], spread.worst)
        return family

    def _gauge(self, what: str, words: str, value: Value) -> Metric:
        return self._filled(GaugeMetricFamily(f"myview_camera_{what}", words, labels=["camera"]), value)

    def _counter(self, what: str, words: str, value: Value) -> Metric:
        return self._filled(CounterMetricFamily(f"myview_camera_{what}", words, labels=["camera"]), value)

    def _filled(self, family: GaugeMetricFamily | CounterMetricFamily, value: Value) -> Metric:
        for camera, state in self._pipeline.ingest.states.items():
            number = value(camera, state)
            if number is not None:
                family.add_metric([camera], number)
        return family


def _of_status(value: Callable[[CameraStatus], float]) -> Value:
    return lambda _, state: None if state.status is None else value(state.status)


_SPREADS: tuple[tuple[str, str, Callable[[CameraState], RecentSeconds | None]], ...] = (
    ("sync_error", "How long after its pulse a frame was taken.", lambda it: it.metrics.sync_error),
    (
        "tracking_delay",
        "How long after the pulse of a window's last frame it was solved.",
        lambda it: it.metrics.tracking_delay,
    ),
)
