"""``/metrics`` for Prometheus: read from the service when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from prometheus_client import CollectorRegistry, Metric, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.registry import Collector

from server.config.running_config import ConfigFileState
from server.http.access.access_control import Access
from server.http.hls.sessions import Readers
from server.service.rendering.render_pool import RenderPool
from server.service.service import BestViewService


class ServiceCollector(Collector):
    """Gives the service's numbers."""

    def __init__(
        self,
        service: BestViewService,
        readers: Readers,
        access: Access,
        on_disk: Callable[[], ConfigFileState],
    ) -> None:
        self._service, self._readers, self._access = service, readers, access
        self._on_disk = on_disk

    def collect(self) -> Iterable[Metric]:
        """Give all metrics as they are now."""
        service = self._service
        yield GaugeMetricFamily("myview_pulse", "Newest pulse.", value=service.pulse)
        yield GaugeMetricFamily("myview_objects", "People known.", value=len(service.board.standings))
        viewers = service.splicer.viewers + service.past.viewers + self._readers.all
        yield GaugeMetricFamily("myview_viewers", "Streams being watched.", value=viewers)
        yield CounterMetricFamily("myview_cuts", "Changes of view.", value=service.board.cuts)
        yield CounterMetricFamily(
            "myview_late_epochs",
            "Windows decided without a camera that was there.",
            value=service.lacking.late_epochs,
        )
        yield CounterMetricFamily(
            "myview_left_out_epochs",
            "Windows not decided at all: their pictures would have been gone by then.",
            value=service.left_out,
        )
        yield CounterMetricFamily(
            "myview_wrong_tokens",
            "Tokens that there is not, or not any more.",
            value=self._access.wrong_tokens,
        )
        yield GaugeMetricFamily(
            "myview_config_differs",
            "The configuration's file is not what runs: wrong, not read again, or waiting for a restart.",
            value=float(self._on_disk().differs),
        )
        yield from self._flags()
        yield from self._recording()
        yield from self._cameras()

    def _flags(self) -> Iterable[Metric]:
        assist = self._service.assist
        flags = CounterMetricFamily("myview_flags", "Flags for the operator.", labels=["state"])
        for state, count in assist.flags.counts.items():
            flags.add_metric([state], count)
        yield flags
        yield GaugeMetricFamily(
            "myview_flags_open", "Flags that can be answered now.", value=len(assist.flags.open)
        )
        yield CounterMetricFamily(
            "myview_pointings", "Places that the operator pointed at.", value=assist.points
        )

    def _recording(self) -> Iterable[Metric]:
        past = self._service.past
        size, writer = past.store.bytes if past.store else 0, past.writer
        well = writer is not None and not writer.stands
        yield GaugeMetricFamily("myview_recording", "What is streamed is being recorded.", value=float(well))
        yield GaugeMetricFamily("myview_recorded_bytes", "Recorded, on the disk.", value=size)
        yield CounterMetricFamily(
            "myview_recorded_gops", "GOPs recorded.", value=writer.written if writer else 0
        )
        yield CounterMetricFamily(
            "myview_unrecorded_gops",
            "GOPs not recorded though they should be.",
            value=writer.lost if writer else 0,
        )

    def _cameras(self) -> Iterable[Metric]:
        live = GaugeMetricFamily("myview_camera_live", "The camera delivers frames.", labels=["camera"])
        frames = CounterMetricFamily("myview_camera_frames", "Frames received.", labels=["camera"])
        missed = CounterMetricFamily("myview_camera_missed", "Pulses without a frame.", labels=["camera"])
        shed = CounterMetricFamily("myview_camera_shed", "Frames not searched for people.", labels=["camera"])
        unheard = CounterMetricFamily(
            "myview_camera_unheard",
            "Frames in which people were followed without what some other camera found.",
            labels=["camera"],
        )
        bad = CounterMetricFamily(
            "myview_camera_bad_messages",
            "Messages not understood: those that the camera has sent, and those that it has heard.",
            labels=["camera", "way"],
        )
        offset = GaugeMetricFamily(
            "myview_camera_clock_offset_seconds",
            "Pulse server's clock minus the camera's.",
            labels=["camera"],
        )
        for camera, state in self._service.intake.states.items():
            labels = [camera]
            live.add_metric(labels, float(state.word == "live"))
            frames.add_metric(labels, state.frames)
            unheard.add_metric(labels, state.unheard)
            bad.add_metric([camera, "sent"], state.bad_messages)
            if state.status is not None:
                missed.add_metric(labels, state.status.missed)
                shed.add_metric(labels, state.status.shed)
                bad.add_metric([camera, "heard"], state.status.bad_messages)
                offset.add_metric(labels, state.status.clock_offset)
        return [live, frames, missed, shed, unheard, bad, offset]


class PicturesCollector(Collector):
    """Gives the numbers of the streams that are decoded."""

    def __init__(self, pictures: RenderPool) -> None:
        self._pictures = pictures

    def collect(self) -> Iterable[Metric]:
        """Give all metrics as they are now."""
        pictures = self._pictures
        yield GaugeMetricFamily(
            "myview_pictures", "People and cameras that are decoded now.", value=len(pictures.sources)
        )
        yield GaugeMetricFamily(
            "myview_pictures_viewers", "Streams of pictures being watched.", value=pictures.viewers
        )
        yield CounterMetricFamily(
            "myview_pictures_restarts", "Drawing processes that died.", value=pictures.restarts
        )
        yield CounterMetricFamily(
            "myview_pictures_lost_gops", "GOPs that came too fast to be drawn.", value=pictures.lost
        )


def registry(
    service: BestViewService,
    pictures: RenderPool,
    readers: Readers,
    access: Access,
    on_disk: Callable[[], ConfigFileState],
) -> CollectorRegistry:
    """Give the metrics of a service and its process."""
    metrics = CollectorRegistry()
    metrics.register(ServiceCollector(service, readers, access, on_disk))
    metrics.register(PicturesCollector(pictures))
    ProcessCollector(registry=metrics)
    return metrics
