"""Minimum quality of detection and tracking, on the synthetic room and on a real recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import av
import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import linear_sum_assignment

from synthetic import Scene
from tracking import DEFAULT_SOLVER, CostSettings, OnlineTracker, WindowSettings, create_solver
from tracking.boxes import iou
from tracking.detectors import BackgroundDetector, BackgroundSettings
from tracking.motchallenge import read_rows

WATERMARK = ((130.0, 232.0), (354.0, 232.0), (354.0, 282.0), (130.0, 282.0))
FRAMES_OF_RECORDING = 300
FRAMES_OF_SCENE = 200
WARM_UP = 50
Boxes = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Quality:
    """Recall of people who are at least half visible, and precision, at an overlap of one half."""

    recall: float
    precision: float


def track_boxes(
    images: Iterable[npt.NDArray[np.uint8]], ignore: tuple[tuple[tuple[float, float], ...], ...] = ()
) -> dict[int, Boxes]:
    """Return the final boxes of every frame, counted from 0."""
    detector = BackgroundDetector(BackgroundSettings(ignore=ignore))
    tracker = OnlineTracker(WindowSettings(), CostSettings(), create_solver(DEFAULT_SOLVER))
    found: dict[int, Boxes] = {}
    results = [tracker.push(frame, detector.detect(image)) for frame, image in enumerate(images)]
    for result in [*results, tracker.flush()]:
        if result is None:
            continue
        for frame in range(result.first, result.final_to + 1):
            rows = [track.boxes[frame - result.first] for track in result.tracks]
            found[frame] = np.array([row for row in rows if not np.isnan(row[0])]).reshape(-1, 4)
    return found


def quality(truth: Mapping[int, tuple[Boxes, npt.NDArray[np.bool_]]], found: Mapping[int, Boxes]) -> Quality:
    """Compute recall and precision; the truth has boxes and which of them count for the recall."""
    people = detected = boxes_found = correct = 0
    for frame, (boxes, counts) in truth.items():
        overlaps = iou(boxes[:, None], found[frame][None])
        rows, columns = linear_sum_assignment(np.where(overlaps >= 0.5, overlaps, 0.0), maximize=True)
        same = overlaps[rows, columns] >= 0.5
        people, boxes_found = people + int(counts.sum()), boxes_found + len(found[frame])
        detected, correct = detected + int(counts[rows[same]].sum()), correct + int(same.sum())
    return Quality(detected / people, correct / boxes_found)


@pytest.mark.slow
def test_people_of_the_room_are_tracked_two_seconds_after_the_start() -> None:
    scene = Scene("room", 3, 4, 1, 640, 360, 25)
    found = track_boxes(scene.image(0, frame) for frame in range(FRAMES_OF_SCENE))
    truth = {}
    for frame in range(WARM_UP, FRAMES_OF_SCENE):
        seen = scene.truth(frame)[0]
        truth[frame] = (seen.boxes, seen.visibility >= 0.5)
    reached = quality(truth, found)
    assert reached.recall >= 0.7, reached
    assert reached.precision >= 0.75, reached


def test_people_of_a_real_terrace_are_tracked(shared_data: Path) -> None:
    with av.open(str(shared_data / "terrace" / "c0.mp4")) as film:
        frames = islice(film.decode(video=0), FRAMES_OF_RECORDING)
        images = [frame.to_ndarray(format="bgr24").astype(np.uint8, copy=False) for frame in frames]
    found = track_boxes(images, (WATERMARK,))
    boxes: dict[int, list[tuple[float, ...]]] = {}
    for row in read_rows(shared_data / "terrace" / "gt" / "c0.txt"):
        if WARM_UP <= row.frame - 1 < FRAMES_OF_RECORDING:
            boxes.setdefault(row.frame - 1, []).append(row.box)
    truth = {frame: (np.array(rows), np.ones(len(rows), dtype=np.bool_)) for frame, rows in boxes.items()}
    reached = quality(truth, found)
    assert reached.recall >= 0.6, reached
    assert reached.precision >= 0.75, reached
