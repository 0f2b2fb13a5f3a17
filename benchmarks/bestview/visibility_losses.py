"""The stages by which people are not visible in their selected view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.bestview.methods import MIN_IOU, MethodResult
from benchmarks.bestview.scenes import BenchmarkScene
from server.cli.evaluate.choices_file import views_of
from server.cli.evaluate.ground_truth import SceneTruth, people_of_objects
from tracking.boxes import iou
from tracking.evaluation import TruthAndTracks
from tracking.motchallenge import MotRow

Mask = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True)
class VisibilityLosses:
    """Shares of the frames in which a person is visible in some camera.

    Attributes:
        visible: visible in the selected view.
        selection: a camera that shows them had a box with their id, but another was selected, or none.
        identity: only boxes with other ids were on them.
        detection: no box was on them in any camera that shows them.
    """

    visible: float
    selection: float
    identity: float
    detection: float


def losses(scene: BenchmarkScene, truth: SceneTruth, result: MethodResult) -> VisibilityLosses:
    """Classify why people are not visible in the selected view.

    Raises:
        ValueError: the method's tracks are the ground truth's.
    """
    if result.ground_truth:
        raise ValueError(f"{result.name}: its tracks are the ground truth")
    recordings = {
        camera: TruthAndTracks(scene.gt[camera], result.rendering.tracks[camera]) for camera in scene.gt
    }
    person_of = people_of_objects(truth.people, recordings, MIN_IOU)
    visible = truth.views.visible
    views = views_of(result.rendering.choices, person_of, truth.people, truth.cameras, visible.shape[1])
    shown = (np.take_along_axis(visible, np.maximum(views, 0)[:, :, None], axis=2)[:, :, 0]) & (views >= 0)
    own, others = _matched(truth, result.rendering.tracks, person_of)
    lost = truth.views.evaluated & ~shown
    by_selection = lost & own
    by_identity = lost & ~own & others
    frames = max(int(np.count_nonzero(truth.views.evaluated)), 1)
    counts = (truth.views.evaluated & shown, by_selection, by_identity, lost & ~own & ~others)
    return VisibilityLosses(*(np.count_nonzero(count) / frames for count in counts))


def _matched(
    truth: SceneTruth, tracks: Mapping[str, list[MotRow]], person_of: Mapping[int, int]
) -> tuple[Mask, Mask]:
    """Return (K, N) whether a visible person had a box with their own id, and with another."""
    own: Mask = np.zeros(truth.views.evaluated.shape, dtype=bool)
    others = own.copy()
    frames = own.shape[1]
    for column, camera in enumerate(truth.cameras):
        for row in tracks[camera]:
            if row.frame > frames:
                continue
            there = truth.views.visible[:, row.frame - 1, column]
            overlap = iou(truth.boxes[:, row.frame - 1, column], np.array(row.box)[None])
            matched = there & (np.nan_to_num(overlap) >= MIN_IOU)
            for person in np.flatnonzero(matched):
                by_selection = person_of.get(row.id) == truth.people[person]
                (own if by_selection else others)[person, row.frame - 1] = True
    return own, others
