"""The scenes of the best-view benchmark: recordings, ground truth and homographies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.bestview.camera_tracks import (
    Rows,
    SceneDetections,
    confident_rows,
    detect_in_pictures,
    read_detections,
)
from benchmarks.common.environment import CannotRunError
from benchmarks.common.recorded_views import RecordedViews, find_views
from server.cli.evaluate.ground_truth import SceneTruth, build_truth
from server.cli.render.video_info import Size
from server.config.loader import build_config
from server.config.site_config import Config
from server.service.view_selection.decider import camera_homographies
from synthetic import Scene, write_recording
from tracking.boxes import Floats
from tracking.motchallenge import read_rows

_AUDITORIUM = ("HC3", "HC4", "IP2", "IP5")
_AUDITORIUM_SIZE, _AUDITORIUM_FPS = (1920, 1080), 30.0
_ROOM_SIZE, _ROOM_FPS, _ROOM_SEED = (640, 360), 25.0, 1
_GALLERY_SIZE = (384, 216)


@dataclass(frozen=True, slots=True, eq=False)
class BenchmarkScene:
    """One scene.

    Attributes:
        name: in the table.
        about: a description for the title.
        content: the configuration, with the known homographies, if any.
        gt: the ground truth of each camera.
        min_visible: the visible share of a person from which a view shows them.
        detections: files of detections; None: detect in the pictures.
        disjoint: whether the cameras have no floor in common.
    """

    name: str
    about: str
    content: Mapping[str, Any]
    gt: Rows
    min_visible: float
    detections: Mapping[str, Path] | None = None
    disjoint: bool = False

    def config(self, *, ground: bool = True, **changes: Mapping[str, Any]) -> Config:
        """Return the configuration, with some settings changed, and with or without homographies.

        Without a kind of detector it is the background, whatever networks are installed.
        """
        content = {**self.content, **changes}
        content["detect"] = {"kind": "background", **content.get("detect", {})}
        if not ground:
            content.pop("ground", None)
        return build_config(content, where=self.name, folder=Path())

    def with_detector(self, detect: Mapping[str, Any]) -> BenchmarkScene:
        """Return the scene with another section `detect`."""
        return replace(self, content={**self.content, "detect": dict(detect)})

    @property
    def calibrated(self) -> bool:
        """Whether there are homographies."""
        return "ground" in self.content

    @property
    def homographies(self) -> dict[str, Floats]:
        """The homography of each camera that has one."""
        found = camera_homographies(self.config())
        return {camera: homography for camera, homography in found.items() if homography is not None}

    @property
    def sizes(self) -> dict[str, Size]:
        """Return the size of each camera's picture, which is the site's."""
        site = self.content["site"]
        return dict.fromkeys(self.gt, (site["width"], site["height"]))

    def truth(self) -> SceneTruth:
        """Return the true visibility of each person in each camera."""
        return build_truth(self.gt, self.sizes, self.min_visible)

    def detect(self, *, ground: bool = True) -> SceneDetections:
        """Detect people in every camera; with `ground`, the detectors use the homographies."""
        config = self.config(ground=ground)
        if self.detections is not None:
            files = self.detections
            return SceneDetections(
                {camera: read_detections(config, files[camera]) for camera in self.gt},
                {camera: read_rows(files[camera]) for camera in self.gt},
            )
        frames = {camera: detect_in_pictures(config, camera) for camera in self.gt}
        return SceneDetections(frames, {camera: confident_rows(frame) for camera, frame in frames.items()})


def recorded(data: Path, name: str) -> BenchmarkScene:
    """Return a recording of the data folder, with detection in its pictures.

    Raises:
        CannotRunError: the recordings are missing.
    """
    return _pictured(find_views(data, name), "recorded")


def terrace(data: Path) -> BenchmarkScene:
    """Return two views, with detection by background subtraction and a masked watermark.

    Raises:
        CannotRunError: the recordings are missing.
    """
    return replace(recorded(data, "terrace"), about="two views, background subtraction")


def auditorium(data: Path) -> BenchmarkScene:
    """Return four views with public detections, without pictures or calibration.

    The occlusion flag of its ground truth is set for almost everyone in two cameras, so it is ignored: each
    person with a box counts as visible.

    Raises:
        CannotRunError: the recordings are missing.
    """
    folder = data / "auditorium"
    if not folder.is_dir():
        raise CannotRunError(f"needs {folder}; --data or MYVIEW_TEST_DATA give the folder")
    width, height = _AUDITORIUM_SIZE
    content = {
        "site": {"name": "bench", "fps": _AUDITORIUM_FPS, "width": width, "height": height},
        "cameras": [{"id": camera, "source": "scene:none"} for camera in _AUDITORIUM],
    }
    gt = {camera: read_rows(folder / "gt" / f"{camera}.txt.gz") for camera in _AUDITORIUM}
    detections = {camera: folder / "det" / f"{camera}.txt.gz" for camera in _AUDITORIUM}
    return BenchmarkScene(
        "auditorium", "four views, public detections, no calibration", content, gt, 0.0, detections
    )


def room(folder: Path, cameras: int, people: int, seconds: float, fps: float = _ROOM_FPS) -> BenchmarkScene:
    """Draw the synthetic room into a new folder."""
    return _drawn(folder, Scene("room", cameras, people, _ROOM_SEED, *_ROOM_SIZE, fps), seconds)


def gallery(folder: Path, people: int, seconds: float) -> BenchmarkScene:
    """Draw the synthetic gallery, whose three cameras have no floor in common, into a new folder."""
    scene = Scene("gallery", 3, people, _ROOM_SEED, *_GALLERY_SIZE, _ROOM_FPS)
    return replace(_drawn(folder, scene, seconds), disjoint=True)


def _drawn(folder: Path, scene: Scene, seconds: float) -> BenchmarkScene:
    name = f"{scene.name}-{scene.cameras}-{scene.objects}"
    write_recording(scene, folder / name, seconds)
    about = f"synthetic, {scene.cameras} cameras, {scene.objects} people, {seconds:g} s"
    return _pictured(find_views(folder, name), about)


def _pictured(views: RecordedViews, about: str) -> BenchmarkScene:
    return BenchmarkScene(views.name, about, views.content, views.truth, 0.25)
