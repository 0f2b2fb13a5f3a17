"""Scores of a run against the truth of its scene: detection, tracks, identities, views."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.detection_scores import ScoredBoxes
from benchmarks.detectors.compared_detectors import CONFIDENT
from benchmarks.scene_runs.pipeline_run import SceneRun
from server.cli.evaluate.ground_truth import build_truth, people_of_objects
from server.cli.evaluate.view_scores import evaluate_views
from server.cli.render.site_file import RenderedSite
from server.config.site_config import Config
from tracking.assignment import assign_pairs
from tracking.evaluation import MultiCameraScores, TruthAndTracks, evaluate_cameras
from tracking.evaluation.frame_matching import align_frames
from tracking.evaluation.track_scores import DEFAULT_MIN_IOU
from tracking.motchallenge import MotRow

Rows = Mapping[str, Sequence[MotRow]]


@dataclass(frozen=True, slots=True, eq=False)
class SceneScores:
    """The scores of one run; shares are in [0, 1].

    Attributes:
        boxes: the detections of all cameras together.
        tracks: HOTA, IDF1 and so on: each camera's, their mean, and joint.
        visible: share of the frames in which a person is visible somewhere that their chosen view shows them.
    """

    boxes: ScoredBoxes
    tracks: MultiCameraScores
    visible: float

    @property
    def recall(self) -> float:
        """The recall of confident detections."""
        return self.boxes.recall(CONFIDENT)

    @property
    def precision(self) -> float:
        """The precision of confident detections."""
        return self.boxes.precision(CONFIDENT)


def score_run(
    config: Config, truth: Rows, run: SceneRun, frames: range | None = None, min_visible: float = 0.25
) -> SceneScores:
    """Score a run.

    Args:
        config: of the site.
        truth: of each camera.
        run: to score.
        frames: frames to score, from 1; None: all.
        min_visible: the visible share of a person from which a view shows them.
    """
    truth = {camera: within(rows, frames) for camera, rows in truth.items()}
    recordings = {
        camera: TruthAndTracks(rows, within(run.rendering.tracks[camera], frames))
        for camera, rows in truth.items()
    }
    boxes = [ScoredBoxes.of(rows, within(run.detections[camera], frames)) for camera, rows in truth.items()]
    sizes = dict.fromkeys(truth, (config.site.width, config.site.height))
    scene = build_truth(truth, sizes, min_visible)
    person_of = people_of_objects(scene.people, recordings, DEFAULT_MIN_IOU)
    choices = [choice for choice in run.rendering.choices if frames is None or choice.frame in frames]
    last = scene.boxes.shape[1]
    views = evaluate_views(
        scene,
        [choice for choice in choices if choice.frame <= last],
        person_of,
        RenderedSite(config.site.fps, config.view.switch_cost_s, sizes),
    )
    return SceneScores(ScoredBoxes.joined(boxes), evaluate_cameras(recordings), views.total.visible)


def within(rows: Sequence[MotRow], frames: range | None) -> list[MotRow]:
    """Return the rows of some frames; None: all."""
    return [row for row in rows if frames is None or row.frame in frames]


def rolling_f1(truth: Rows, tracks: Rows, frames: int, window: int) -> NDArray[np.float64]:
    """Return the F1 score of the tracks' boxes in all cameras, over windows of frames (frames - window + 1,).

    Windows without people and boxes have the score 1.
    """
    matched, boxes = np.zeros(frames + 1), np.zeros(frames + 1)
    for camera, rows in truth.items():
        numbers = sorted({row.frame for row in (*rows, *tracks[camera])})
        for number, frame in zip(numbers, align_frames(rows, tracks[camera], DEFAULT_MIN_IOU), strict=True):
            if number <= frames:
                pairs, _ = assign_pairs(frame.similarity, DEFAULT_MIN_IOU)
                matched[number] += 2 * len(pairs)
                boxes[number] += sum(frame.similarity.shape)
    matched, boxes = np.cumsum(matched), np.cumsum(boxes)
    counts = boxes[window:] - boxes[:-window]
    return np.where(counts > 0, (matched[window:] - matched[:-window]) / np.maximum(counts, 1), 1.0)
