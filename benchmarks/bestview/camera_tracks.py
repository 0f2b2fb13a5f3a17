"""Each camera's detections, from pictures or files, and its track messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.detectors.compared_detectors import CONFIDENT, rows_of
from server.camera.observations import ObservationCollector, most_confident
from server.camera.peers.cross_view_scorer import CrossViewScorer
from server.camera.pipeline import CameraPipeline
from server.camera.sources import SourceEndedError
from server.camera.track_messages import TrackMessageBuilder
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.messages import CameraTracks
from tracking import Detections, OnlineTracker
from tracking.detectors import MotFileDetector
from tracking.motchallenge import MotRow

Messages = Mapping[str, list[CameraTracks]]
"""Each camera's track messages, epoch by epoch."""

Rows = Mapping[str, list[MotRow]]
"""Boxes of each camera."""

_NO_PICTURE = np.empty((0, 0, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class CameraDetections:
    """One camera's detections, frame by frame.

    Attributes:
        size: of the camera's pictures.
        detections: of each frame.
        searched: whether the detector could search the frame.
    """

    size: tuple[int, int]
    detections: list[Detections]
    searched: list[bool]


@dataclass(frozen=True, slots=True)
class SceneDetections:
    """The detections of all cameras of a scene.

    Attributes:
        frames: all detections.
        boxes: the detections that other trackers get: those of a file, or the confident ones of the detector.
    """

    frames: Mapping[str, CameraDetections]
    boxes: Rows


def detect_in_pictures(config: Config, camera: str) -> CameraDetections:
    """Detect people in a recording as a camera process does, without encoding."""
    pipeline = CameraPipeline(config, camera)
    frames = CameraDetections(pipeline.source.size, [], [])
    for pulse in count():
        try:
            search_result = pipeline.detect(pulse, pipeline.take(pulse))
        except SourceEndedError:
            break
        frames.detections.append(search_result.detections)
        frames.searched.append(search_result.has_detection)
    pipeline.close()
    return frames


def read_detections(config: Config, path: Path) -> CameraDetections:
    """Read detections without pictures, as `myview track --det` does."""
    detector = MotFileDetector(path)
    detections = [detector.detect(_NO_PICTURE, pulse) for pulse in range(detector.last_frame + 1)]
    return CameraDetections((config.site.width, config.site.height), detections, [True] * len(detections))


def confident_rows(frames: CameraDetections) -> list[MotRow]:
    """Return the confident detections."""
    rows = (row for pulse, detections in enumerate(frames.detections) for row in rows_of(pulse, detections))
    return [row for row in rows if row.confidence >= CONFIDENT]


def track_scene(config: Config, frames: Mapping[str, CameraDetections]) -> dict[str, list[CameraTracks]]:
    """Track people in all cameras frame by frame, as `myview render` does; return each camera's messages."""
    cameras = {camera: _Camera(config, camera, frame) for camera, frame in frames.items()}
    messages: dict[str, list[CameraTracks]] = {camera: [] for camera in frames}
    for pulse in range(max(len(frame.detections) for frame in frames.values())):
        active = {
            camera: reader for camera, reader in cameras.items() if pulse < len(frames[camera].detections)
        }
        shared = {
            camera: reader.scorer.build_message(pulse, reader.shared(pulse))
            for camera, reader in active.items()
            if reader.scorer
        }
        for camera, reader in active.items():
            detections = frames[camera].detections[pulse]
            if reader.scorer is not None:
                others = [message for other, message in shared.items() if other != camera]
                detections = reader.scorer.rescore(detections, others)
            reader.observe(pulse)
            result = reader.tracker.push(pulse, detections)
            if result is not None:
                messages[camera].append(reader.with_observations(reader.builder.regular(result)))
    for camera, reader in cameras.items():
        closing = reader.builder.closing(reader.tracker.flush(), len(frames[camera].detections) - 1)
        messages[camera].append(reader.with_observations(closing))
    return messages


class _Camera:
    """The tracker, the message builder and the cross-view scorer of one camera."""

    def __init__(self, config: Config, camera: str, frames: CameraDetections) -> None:
        track = config.track
        center = frames.size[0] / 2.0, frames.size[1] / 2.0
        self.tracker = OnlineTracker(
            track.window, track.costs, track.create_solver(config.site.fps), config.site.fps, center
        )
        self.builder = TrackMessageBuilder(camera, 0, frames.size, config.window.stride)
        self.scorer = CrossViewScorer(config, camera, frames.size, 0) if config.peers_of(camera) else None
        site = config.site.size
        self._observations = (
            ObservationCollector(Letterbox(frames.size, site), config.window.stride)
            if camera in config.joint_cameras
            else None
        )
        self._frames = frames

    def observe(self, pulse: int) -> None:
        """Keep the detections of a frame for joint tracking, where the scene is tracked so."""
        if self._observations is not None and self._frames.searched[pulse]:
            self._observations.add(pulse, most_confident(self._frames.detections[pulse]), None)

    def with_observations(self, message: CameraTracks) -> CameraTracks:
        """Return a message with the detections since the one before."""
        if self._observations is None:
            return message
        return msgspec.structs.replace(message, observations=self._observations.take(message.last))

    def shared(self, pulse: int) -> Detections | None:
        """Return the detections of a frame for other cameras; None if the frame was not searched."""
        return self._frames.detections[pulse] if self._frames.searched[pulse] else None
