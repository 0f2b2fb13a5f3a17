"""The scenes of the detector benchmark, and the scores of boxes and tracks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import av
import numpy as np

from benchmarks.common.environment import CannotRunError
from tracking.detectors import Image
from tracking.evaluation import TruthAndTracks, evaluate, evaluate_cameras, oracle_association
from tracking.motchallenge import MotRow, read_rows

WATERMARK = ((130.0, 232.0), (354.0, 232.0), (354.0, 282.0), (130.0, 282.0))
"""The polygon of a translucent watermark, which hides the background."""

_SMALLEST = {"pets09": 0.12}


@dataclass(frozen=True, slots=True)
class ScoredView:
    """One camera's recording."""

    name: str
    video: Path
    truth: Path | None
    watermark: bool
    min_height: float
    """Height of the smallest people, in picture heights, for HOG, whose time depends on it."""

    @property
    def ignore(self) -> tuple[tuple[tuple[float, float], ...], ...]:
        """The ignored polygons."""
        return (WATERMARK,) if self.watermark else ()

    def images(self, max_frames: int | None = None) -> Iterator[Image]:
        """Yield the first `max_frames` frames as BGR images."""
        with av.open(str(self.video)) as container:
            for frame in islice(container.decode(video=0), max_frames):
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
    folder = data / scene
    views = []
    for video in sorted(folder.glob("*.mp4")):
        truth = folder / "gt" / f"{video.stem}.txt"
        watermark, min_height = scene in {"terrace", "campus4"}, _SMALLEST.get(scene, 0.25)
        views.append(ScoredView(video.stem, video, truth if truth.exists() else None, watermark, min_height))
    if not views:
        raise CannotRunError(
            f"needs the recordings {folder}/*.mp4; --data or MYVIEW_TEST_DATA give the folder"
        )
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
