"""What every camera of a scene says when it tracks by itself: from pictures, or from files of detections."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from benchmarks.observers import SURE, rows_of
from server.camera.observe import Observer
from server.camera.pipeline import CameraPipeline
from server.camera.report import Reporter
from server.camera.sources import SourceEnded
from server.wire.config import Config
from server.wire.messages import CameraTracks
from tracking import Detections, OnlineTracker, solver_named
from tracking.detectors import Image, MotFileDetector
from tracking.motchallenge import MotRow

Messages = Mapping[str, list[CameraTracks]]
"""What each camera said, epoch by epoch."""

Rows = Mapping[str, list[MotRow]]
"""Boxes of each camera."""

_NO_PICTURE = np.empty((0, 0, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class Watched:
    """What the cameras of a scene made of it, each by itself.

    Attributes:
        messages: what each said.
        boxes: the detections that other trackers get: those of a file, or what the detector is sure of.
    """

    messages: Messages
    boxes: Rows


class Listening:
    """A detector that passes on what another finds, and keeps what it is sure of."""

    def __init__(self, detector: Observer, kept: list[MotRow]) -> None:
        self._detector, self._kept = detector, kept
        self.bins = detector.bins

    def detect(self, image: Image, frame: int | None = None) -> Detections:
        """Give what the other finds."""
        found = self._detector.detect(image, frame)
        self._kept += (row for row in rows_of(frame or 0, found) if row.confidence >= SURE)
        return found


def from_pictures(config: Config, camera: str, found: list[MotRow]) -> Iterator[CameraTracks]:
    """Search a recording: what a camera's process would say, without encoding anything.

    `found` takes up the detections.
    """
    pipeline = CameraPipeline(config, camera)
    pipeline._detector = Listening(pipeline._detector, found)  # noqa: SLF001 — what it finds is nowhere told
    for pulse in count():
        try:
            image = pipeline.take(pulse)
        except SourceEnded:
            break
        message = pipeline.track(pulse, image)
        if message is not None:
            yield message
    yield pipeline.finish(pulse)
    pipeline.close()


def from_detections(config: Config, camera: str, path: Path) -> Iterator[CameraTracks]:
    """Track detections without pictures, as `myview track --det` does."""
    detector = MotFileDetector(path)
    settings, site = config.track, config.site
    tracker = OnlineTracker(settings.window, settings.costs, solver_named(settings.solver))
    reporter = Reporter(camera, 0, (site.width, site.height), settings.window.stride)
    for pulse in range(detector.last + 1):
        result = tracker.push(pulse, detector.detect(_NO_PICTURE, pulse))
        if result is not None:
            yield reporter.regular(result)
    yield reporter.closing(tracker.flush(), detector.last)
