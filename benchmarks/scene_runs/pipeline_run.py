"""A scene through the cameras' pipelines and the view decider, as in `myview render`, without encoding."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from benchmarks.bestview.service_decisions import Rendering, decide
from benchmarks.detectors.compared_detectors import rows_of
from server.camera.captured_frame import CapturedFrame
from server.camera.encoder import AccessUnit
from server.camera.pipeline import CameraPipeline, DetectedFrame
from server.camera.sources import FrameSource, Image, SourceEndedError, open_source
from server.camera.sources.opening import open_video
from server.cli.render.camera_workers import run_cameras
from server.config.site_config import Config
from server.messaging.messages import CameraTracks
from tracking.motchallenge import MotRow


@dataclass(frozen=True, slots=True, eq=False)
class SceneRun:
    """What was detected, tracked and decided.

    Attributes:
        detections: each camera's detections, before rescoring by other cameras.
        rendering: tracks by person, and chosen views.
        frames: of all cameras together.
        camera_s: processor time of all cameras.
    """

    detections: Mapping[str, list[MotRow]]
    rendering: Rendering
    frames: int
    camera_s: float


class LimitedSource:
    """The first frames of a source."""

    def __init__(self, source: FrameSource, frames: int) -> None:
        self._source, self._frames = source, frames
        self.size, self.recorded = source.size, source.recorded

    def take(self, pulse: int) -> Image | None:
        """Return the image of a pulse; None: there is none.

        Raises:
            SourceEndedError: these were all frames.
        """
        if pulse >= self._frames:
            raise SourceEndedError
        return self._source.take(pulse)

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        """Return those of the first frames that have these indices."""
        return self._source.prescan_images([index for index in indices if index < self._frames])

    def close(self) -> None:
        """Close the source."""
        self._source.close()


class _ObservedPipeline(CameraPipeline):
    """Keeps what it detects, and does not encode."""

    def __init__(self, config: Config, camera: str, source: FrameSource) -> None:
        super().__init__(config, camera, source=source)
        self.detections: list[MotRow] = []
        self.frames = 0

    def encode(self, pulse: int, frame: CapturedFrame) -> AccessUnit:
        """Return no data."""
        del frame
        return AccessUnit(pulse, key=True, data=b"")

    def detect(
        self, pulse: int, frame: CapturedFrame | None, *, skipped: bool = False, network_factor: int = 1
    ) -> DetectedFrame:
        """Detect people in a frame, and keep them."""
        detected = super().detect(pulse, frame, skipped=skipped, network_factor=network_factor)
        self.detections += rows_of(pulse, detected.detections)
        self.frames += 1
        return detected


def open_frames(config: Config, camera: str, frames: int | None = None) -> FrameSource:
    """Open the frames of a camera; `frames`: at most so many."""
    source = open_source(config.camera(camera), config.site)
    return source if frames is None else LimitedSource(source, frames)


class SceneRunner:
    """All cameras of a scene in step, each with its frames, and then the decision of the views."""

    def __init__(self, config: Config, sources: Mapping[str, FrameSource]) -> None:
        start = time.process_time()
        self._config = config
        self._pipelines = {
            camera: _ObservedPipeline(config, camera, source) for camera, source in sources.items()
        }
        self._messages: dict[str, list[CameraTracks]] = {camera: [] for camera in self._pipelines}
        self._batches = run_cameras(self._pipelines)
        self._camera_s = time.process_time() - start

    def run_before(self, frame: int) -> None:
        """Run to the last end of an epoch before a frame; that frame is not taken."""
        last_epoch = frame - self._config.window.stride
        if all(pipeline.frames <= last_epoch for pipeline in self._pipelines.values()):
            self._run(lambda: min(pipeline.frames for pipeline in self._pipelines.values()) > last_epoch)

    def finish(self) -> SceneRun:
        """Run to the end."""
        self._run(lambda: False)
        return SceneRun(
            {camera: pipeline.detections for camera, pipeline in self._pipelines.items()},
            decide(self._config, self._messages),
            sum(pipeline.frames for pipeline in self._pipelines.values()),
            self._camera_s,
        )

    def _run(self, is_enough: Callable[[], bool]) -> None:
        start = time.process_time()
        for batch in self._batches:
            if batch.tracks is not None:
                self._messages[batch.camera].append(batch.tracks)
            if is_enough():
                break
        self._camera_s += time.process_time() - start


def run_scene(config: Config, sources: Mapping[str, FrameSource]) -> SceneRun:
    """Run a scene from beginning to end."""
    return SceneRunner(config, sources).finish()


def length_in_frames(config: Config) -> int:
    """Return the number of frames of the shortest recording, at the site's rate."""
    lengths = []
    for camera in config.cameras:
        opened = open_video(camera.source)
        opened.container.close()
        lengths.append(round(opened.frames / opened.fps * config.site.fps))
    return min(lengths)
