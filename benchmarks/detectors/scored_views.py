"""The scenes of the detector benchmark, and the scores of boxes and tracks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import av
import numpy as np

from benchmarks.common.recorded_views import find_views
from server.camera.detector_setup import make_detector
from server.config.loader import build_config
from server.media.letterbox import Letterbox
from tracking.detectors import Detector, Image
from tracking.detectors.ignore_mask import Polygons
from tracking.evaluation import TruthAndTracks, evaluate, evaluate_cameras, oracle_association
from tracking.motchallenge import MotRow, read_rows

_SMALLEST = {"pets09": 0.12}


@dataclass(frozen=True, slots=True)
class ScoredView:
    """One camera's recording.

    Attributes:
        camera: its section of the configuration: name, recording, ignored polygons.
        truth: the file of its ground truth; None: there is none.
        min_height: height of the smallest people, in picture heights, for HOG, whose time depends on it.
    """

    camera: Mapping[str, Any]
    truth: Path | None
    min_height: float

    @property
    def name(self) -> str:
        """The name of the view."""
        return str(self.camera["id"])

    @property
    def ignore(self) -> Polygons:
        """The ignored polygons."""
        return tuple(
            tuple((float(x), float(y)) for x, y in polygon) for polygon in self.camera.get("ignore", ())
        )

    def make_detector(self, detect: Mapping[str, Any], size: tuple[int, int]) -> Detector:
        """Return the detector that a section `detect` names, for images of `size` = (width, height).

        It knows nothing about the recording in advance: neither its background nor its floor.
        """
        site = {"name": "bench", "width": size[0], "height": size[1]}
        content = {"site": site, "cameras": [dict(self.camera)], "detect": dict(detect)}
        config = build_config(content, where=self.name, folder=Path())
        return make_detector(config, config.camera(self.name), Letterbox(size, size))

    def images(self, max_frames: int | None = None, every: int = 1) -> Iterator[Image]:
        """Yield every n-th of the first `max_frames` frames as BGR images."""
        with av.open(self.camera["source"]) as container:
            for frame in islice(container.decode(video=0), 0, max_frames, every):
                yield np.asarray(frame.to_ndarray(format="bgr24"), dtype=np.uint8)

    def people(self, frames: int | None) -> list[MotRow]:
        """Return the ground truth of the first `frames` frames."""
        if self.truth is None:
            return []
        return [row for row in read_rows(self.truth) if frames is None or row.frame <= frames]


def views_of(data: Path, scene: str) -> list[ScoredView]:
    """Return the views of a scene.

    Raises:
        CannotRunError: its recordings are missing.
    """
    views = []
    for camera in find_views(data, scene).cameras:
        truth = data / scene / "gt" / f"{camera['id']}.txt"
        views.append(ScoredView(camera, truth if truth.exists() else None, _SMALLEST.get(scene, 0.25)))
    return views


@dataclass(frozen=True, slots=True)
class ViewScores:
    """Scores at an overlap (IoU) of one half, in [0, 1]."""

    recall: float
    precision: float
    idf1: float


def scores_of_boxes(truth: list[MotRow], boxes: list[MotRow]) -> ViewScores:
    """Score detections; recall and IDF1 are upper bounds of any association."""
    correct = oracle_association(boxes, truth)
    people = sum(row.confidence != 0.0 for row in truth)
    recall = len(correct) / max(people, 1)
    precision = len(correct) / max(len(boxes), 1)
    return ViewScores(recall, precision, 2.0 * len(correct) / max(people + len(correct), 1))


def scores_of_tracks(truth: list[MotRow], tracks: list[MotRow]) -> ViewScores:
    """Score tracks."""
    found = evaluate(truth, tracks)
    return ViewScores(found.recall, found.precision, found.idf1)


def oracle(truths: dict[str, list[MotRow]], boxes: dict[str, list[MotRow]]) -> float:
    """Return the joint IDF1 over all cameras of boxes with the true identities."""
    cameras = {
        name: TruthAndTracks(truth, oracle_association(boxes[name], truth)) for name, truth in truths.items()
    }
    return evaluate_cameras(cameras).joint.idf1
