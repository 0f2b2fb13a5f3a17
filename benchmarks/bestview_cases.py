"""The scenes that best views are measured on: recordings, what is really there, and where the floor is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.observers import SURE, rows_of
from benchmarks.surroundings import CannotRunError
from benchmarks.views import Views, find_views
from server.camera.observe import Observer
from server.camera.pipeline import CameraPipeline
from server.camera.report import Reporter
from server.camera.scene import Scene, write_recording
from server.camera.sources import SourceEnded
from server.run.evaluate_truth import Truth, truth_of
from server.run.recorded import Size
from server.wire.config import Config
from server.wire.loading import build_config
from server.wire.messages import CameraTracks
from tracking import Detections, OnlineTracker, solver_named
from tracking.detectors import Image, MotFileDetector
from tracking.motchallenge import MotRow, read_rows

Messages = Mapping[str, list[CameraTracks]]
"""What each camera said, epoch by epoch."""

Rows = Mapping[str, list[MotRow]]
"""Boxes of each camera."""

_AUDITORIUM = ("HC3", "HC4", "IP2", "IP5")
_AUDITORIUM_SIZE, _AUDITORIUM_FPS = (1920, 1080), 30.0
_ROOM_SIZE, _ROOM_FPS, _ROOM_SEED = (640, 360), 25.0, 1
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


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One scene.

    Attributes:
        name: what the table calls it.
        about: what it is, for the title.
        content: the configuration, with the homographies that are known, if any.
        gt: the ground truth of each camera.
        least_shown: the share of a person that has to show for a view to show them.
        detections: files to track by; None: the pictures are searched.
    """

    name: str
    about: str
    content: Mapping[str, Any]
    gt: Rows
    least_shown: float
    detections: Mapping[str, Path] | None = None

    def config(self, *, ground: bool = True, **changes: Mapping[str, Any]) -> Config:
        """Give the configuration, with some settings changed, and with or without homographies."""
        content = {**self.content, **changes}
        if not ground:
            content.pop("ground", None)
        return build_config(content, where=self.name, folder=Path())

    @property
    def calibrated(self) -> bool:
        """Whether there are homographies."""
        return "ground" in self.content

    @property
    def sizes(self) -> dict[str, Size]:
        """Give the size of each camera's picture, which is the site's."""
        site = self.content["site"]
        return dict.fromkeys(self.gt, (site["width"], site["height"]))

    def truth(self) -> Truth:
        """Give how well everybody could be seen."""
        return truth_of(self.gt, self.sizes, self.least_shown)

    def watch(self) -> Watched:
        """Let every camera track by itself."""
        config = self.config()
        if self.detections is not None:
            files = self.detections
            return Watched(
                {camera: list(_from_detections(config, camera, files[camera])) for camera in self.gt},
                {camera: read_rows(files[camera]) for camera in self.gt},
            )
        messages, boxes = {}, {}
        for camera in self.gt:
            boxes[camera] = found = list[MotRow]()
            messages[camera] = list(_from_pictures(config, camera, found))
        return Watched(messages, boxes)


def terrace(data: Path) -> Case:
    """Two views, searched by background subtraction, the watermark masked.

    Raises:
        CannotRunError: it is not there.
    """
    views = find_views(data, "terrace")
    folder = data / "terrace"
    gt = {video.stem: read_rows(folder / "gt" / f"{video.stem}.txt") for video in views.videos}
    return Case("terrace", "two views, background subtraction", _content(views), gt, 0.25)


def auditorium(data: Path) -> Case:
    """Four views without pictures or calibration, by public detections.

    Its flag of who is hidden is set for nearly everybody in two cameras, so that it says nothing: whoever
    has a box counts as visible.

    Raises:
        CannotRunError: it is not there.
    """
    folder = data / "auditorium"
    if not folder.is_dir():
        raise CannotRunError(f"needs {folder}; --data or MYVIEW_TEST_DATA say where")
    width, height = _AUDITORIUM_SIZE
    content = {
        "site": {"name": "bench", "fps": _AUDITORIUM_FPS, "width": width, "height": height},
        "cameras": [{"id": camera, "source": "scene:none"} for camera in _AUDITORIUM],
    }
    gt = {camera: read_rows(folder / "gt" / f"{camera}.txt.gz") for camera in _AUDITORIUM}
    detections = {camera: folder / "det" / f"{camera}.txt.gz" for camera in _AUDITORIUM}
    return Case("auditorium", "four views, public detections, no calibration", content, gt, 0.0, detections)


def room(folder: Path, cameras: int, people: int, seconds: float) -> Case:
    """Draw the synthetic scene into a new folder."""
    scene = Scene("room", cameras, people, _ROOM_SEED, *_ROOM_SIZE, _ROOM_FPS)
    name = f"room-{cameras}-{people}"
    write_recording(scene, folder / name, seconds)
    views = find_views(folder, name)
    gt = {video.stem: read_rows(folder / name / "gt" / f"{video.stem}.txt") for video in views.videos}
    about = f"synthetic, {cameras} cameras, {people} people, {seconds:g} s"
    return Case(name, about, _content(views), gt, 0.25)


def _content(views: Views) -> dict[str, Any]:
    content = {"site": views.site, "cameras": views.cameras}
    if views.ground is not None:
        content["ground"] = str(views.ground.absolute())
    return content


def _from_pictures(config: Config, camera: str, found: list[MotRow]) -> Iterator[CameraTracks]:
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


def _from_detections(config: Config, camera: str, path: Path) -> Iterator[CameraTracks]:
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
