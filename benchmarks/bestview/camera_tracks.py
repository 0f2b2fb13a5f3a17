"""What every camera of a scene finds, in pictures or in files, and what they say when they follow it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from benchmarks.detectors.compared_detectors import SURE, rows_of
from server.camera.peers.cross_view_scorer import CrossViewScorer
from server.camera.pipeline import CameraPipeline
from server.camera.sources import SourceEndedError
from server.camera.track_messages import TrackMessageBuilder
from server.config.site_config import Config
from server.messaging.messages import CameraTracks
from tracking import Detections, OnlineTracker, create_solver
from tracking.detectors import MotFileDetector
from tracking.motchallenge import MotRow

Messages = Mapping[str, list[CameraTracks]]
"""What each camera said, epoch by epoch."""

Rows = Mapping[str, list[MotRow]]
"""Boxes of each camera."""

_NO_PICTURE = np.empty((0, 0, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class CameraDetections:
    """What one camera found, frame by frame.

    Attributes:
        size: of its own pictures.
        found: its detections.
        looked: whether the frame could be searched.
    """

    size: tuple[int, int]
    found: list[Detections]
    looked: list[bool]


@dataclass(frozen=True, slots=True)
class SceneDetections:
    """What the cameras of a scene found, each by itself.

    Attributes:
        frames: all of it.
        boxes: the detections that other trackers get: those of a file, or what the detector is sure of.
    """

    frames: Mapping[str, CameraDetections]
    boxes: Rows


def in_pictures(config: Config, camera: str) -> CameraDetections:
    """Search a recording as a camera's process does, without encoding anything."""
    pipeline = CameraPipeline(config, camera)
    frames = CameraDetections(pipeline.source.size, [], [])
    for pulse in count():
        try:
            searched = pipeline.detect(pulse, pipeline.take(pulse))
        except SourceEndedError:
            break
        frames.found.append(searched.detections)
        frames.looked.append(searched.is_searched)
    pipeline.close()
    return frames


def in_file(config: Config, path: Path) -> CameraDetections:
    """Read detections without pictures, as `myview track --det` does."""
    detector = MotFileDetector(path)
    found = [detector.detect(_NO_PICTURE, pulse) for pulse in range(detector.last_frame + 1)]
    return CameraDetections((config.site.width, config.site.height), found, [True] * len(found))


def sure_rows(frames: CameraDetections) -> list[MotRow]:
    """Return what the detector is sure of."""
    rows = (row for pulse, found in enumerate(frames.found) for row in rows_of(pulse, found))
    return [row for row in rows if row.confidence >= SURE]


def followed(config: Config, frames: Mapping[str, CameraDetections]) -> dict[str, list[CameraTracks]]:
    """Follow everybody in all cameras, in step, as `myview render` does; give what each of them says."""
    cameras = {camera: _Camera(config, camera, it) for camera, it in frames.items()}
    messages: dict[str, list[CameraTracks]] = {camera: [] for camera in frames}
    for pulse in range(max(len(it.found) for it in frames.values())):
        there = {camera: it for camera, it in cameras.items() if pulse < len(frames[camera].found)}
        words = {
            camera: it.witness.build_message(pulse, it.told(pulse))
            for camera, it in there.items()
            if it.witness
        }
        for camera, it in there.items():
            detections = frames[camera].found[pulse]
            if it.witness is not None:
                others = [word for other, word in words.items() if other != camera]
                detections = it.witness.rescore(detections, others)
            result = it.tracker.push(pulse, detections)
            if result is not None:
                messages[camera].append(it.reporter.regular(result))
    for camera, it in cameras.items():
        messages[camera].append(it.reporter.closing(it.tracker.flush(), len(frames[camera].found) - 1))
    return messages


class _Camera:
    """What one camera follows people with."""

    def __init__(self, config: Config, camera: str, frames: CameraDetections) -> None:
        track = config.track
        self.tracker = OnlineTracker(track.window, track.costs, create_solver(track.solver))
        self.reporter = TrackMessageBuilder(camera, 0, frames.size, track.window.stride)
        self.witness = CrossViewScorer(config, camera, frames.size, 0) if config.witnesses(camera) else None
        self._frames = frames

    def told(self, pulse: int) -> Detections | None:
        """Return what the others are told of a frame."""
        return self._frames.found[pulse] if self._frames.looked[pulse] else None
