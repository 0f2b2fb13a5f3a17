"""The facade of the best-view service: all queries and commands that HTTP uses."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from prometheus_client import CollectorRegistry

from server.config.site_config import Config
from server.service.facade.assist import AssistService
from server.service.facade.calibration import CalibrationService
from server.service.facade.cameras import CameraService
from server.service.facade.deletion import DeletionService
from server.service.facade.operations import OperationsService
from server.service.facade.past_search import PastSearchService
from server.service.facade.people import PeopleService
from server.service.facade.recordings import RecordingService
from server.service.facade.rendering import RenderPool
from server.service.facade.rules import RulesService
from server.service.facade.sites import SitesService
from server.service.facade.streams import StreamService
from server.service.metrics.service_collector import register_collectors
from server.service.pipeline import BestViewPipeline


class BestViewService:
    """Queries and commands over a running pipeline, grouped by subject.

    Attributes:
        people: people, their views, and manual corrections.
        rules: zones and rules, and what they have found.
        cameras: state and diagnostics of the cameras.
        sites: other sites.
        streams: live streams.
        recordings: recorded streams.
        deletion: deletion of people's data.
        past_search: search of recorded decisions.
        rendering: JPEG pictures, and video with boxes burnt in.
        assist: flags for the operator, and position corrections.
        calibration: the calibration walk.
        operations: readiness, pulse clients, view settings.
    """

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline = pipeline
        self.people = PeopleService(pipeline)
        self.rules = RulesService(pipeline, self.people)
        self.cameras = CameraService(pipeline)
        self.sites = SitesService(pipeline)
        self.streams = StreamService(pipeline)
        self.recordings = RecordingService(pipeline)
        self.deletion = DeletionService(pipeline, self.people, self.rules)
        self.past_search = PastSearchService(pipeline)
        self.rendering = RenderPool(pipeline)
        self.assist = AssistService(pipeline)
        self.calibration = CalibrationService(pipeline)
        self.operations = OperationsService(pipeline)

    @property
    def config(self) -> Config:
        """The configuration in force."""
        return self._pipeline.config

    @property
    def pulse(self) -> int:
        """The newest pulse; -1 before the first."""
        return self._pipeline.pulses.newest

    @property
    def pulse0(self) -> float | None:
        """When pulse 0 was due, unix seconds; None before the first pulse."""
        return self._pipeline.pulses.pulse0

    @property
    def decided_end(self) -> int:
        """The pulse after the newest decided frame."""
        return self._pipeline.decision_state.end

    def register_metrics(self, registry: CollectorRegistry, queues: Mapping[str, Callable[[], int]]) -> None:
        """Register the metrics of cameras and service; ``queues`` are further queue lengths, by name."""
        register_collectors(registry, self._pipeline, self.rendering, queues)
