"""A scene through the cameras' pipelines and the view decider, as in `myview render`, without encoding."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.bestview.service_decisions import Rendering, decide
from benchmarks.detectors.compared_detectors import rows_of
from server.camera.encoder import AccessUnit
from server.camera.pipeline import CameraPipeline, DetectedFrame
from server.camera.sources import FrameSource, Image, SourceEndedError, open_source
from server.camera.sources.opening import open_video
from server.cli.render.camera_workers import run_cameras
from server.config.site_config import Config
from server.messaging.messages import CameraTracks
from server.models.catalog import find_model
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

    def encode(self, pulse: int, image: Image) -> AccessUnit:
        """Return no data."""
        del image
        return AccessUnit(pulse, key=True, data=b"")

    def detect(self, pulse: int, image: Image | None, *, skipped: bool = False) -> DetectedFrame:
        """Detect people in a frame, and keep them."""
        frame = super().detect(pulse, image, skipped=skipped)
        self.detections += rows_of(pulse, frame.detections)
        self.frames += 1
        return frame


def open_sources(config: Config, frames: int | None = None) -> dict[str, FrameSource]:
    """Open the frames of all cameras; `frames`: at most so many of each."""
    sources: dict[str, FrameSource] = {
        camera.id: open_source(camera, config.site) for camera in config.cameras
    }
    if frames is None:
        return sources
    return {camera: LimitedSource(source, frames) for camera, source in sources.items()}


def run_scene(config: Config, sources: Mapping[str, FrameSource]) -> SceneRun:
    """Run all cameras in step, each with its frames, then decide the views."""
    start = time.process_time()
    pipelines = {camera: _ObservedPipeline(config, camera, source) for camera, source in sources.items()}
    messages: dict[str, list[CameraTracks]] = {camera: [] for camera in pipelines}
    for batch in run_cameras(pipelines):
        if batch.tracks is not None:
            messages[batch.camera].append(batch.tracks)
    camera_s = time.process_time() - start
    return SceneRun(
        {camera: pipeline.detections for camera, pipeline in pipelines.items()},
        decide(config, messages),
        sum(pipeline.frames for pipeline in pipelines.values()),
        camera_s,
    )


def length_in_frames(config: Config) -> int:
    """Return the number of frames of the shortest recording, at the site's rate."""
    lengths = []
    for camera in config.cameras:
        opened = open_video(camera.source)
        opened.container.close()
        lengths.append(round(opened.frames / opened.fps * config.site.fps))
    return min(lengths)


def detector_settings(name: str) -> dict[str, Any]:
    """Return the section `detect` for an installed network, or for a kind of detector."""
    if find_model(name) is None:
        return {"kind": name}
    return {"kind": "onnx", "onnx": {"model": name}}
