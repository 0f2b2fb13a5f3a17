"""Why somebody is not visible in the view that was chosen for them: who of the stages lost them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.bestview.methods import LEAST_IOU, MethodResult
from benchmarks.bestview.scenes import BenchmarkScene
from server.cli.evaluate.choices_file import views_of
from server.cli.evaluate.ground_truth import SceneTruth, people_of_objects
from tracking.boxes import iou
from tracking.evaluation import TruthAndTracks
from tracking.motchallenge import MotRow

Mask = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True)
class VisibilityLosses:
    """Shares of the frames in which somebody is visible in some camera.

    Attributes:
        visible: they are so in the chosen one.
        choice: their number was at them in a camera that shows them, yet another was chosen, or none.
        number: only other numbers were at them.
        missed: no box was at them, in any camera that shows them.
    """

    visible: float
    choice: float
    number: float
    missed: float


def losses(case: BenchmarkScene, truth: SceneTruth, way: MethodResult) -> VisibilityLosses:
    """Classify what keeps people from being visible in the chosen view.

    Raises:
        ValueError: the way has no boxes of its own.
    """
    if way.given:
        raise ValueError(f"{way.name}: its boxes are the truth's")
    recordings = {camera: TruthAndTracks(case.gt[camera], way.rendering.tracks[camera]) for camera in case.gt}
    person_of = people_of_objects(truth.people, recordings, LEAST_IOU)
    visible = truth.views.visible
    views = views_of(way.rendering.choices, person_of, truth.people, truth.cameras, visible.shape[1])
    shown = (np.take_along_axis(visible, np.maximum(views, 0)[:, :, None], axis=2)[:, :, 0]) & (views >= 0)
    own, others = _met(truth, way.rendering.tracks, person_of)
    lost = truth.views.evaluated & ~shown
    mine = lost & own
    wrong = lost & ~own & others
    frames = max(int(np.count_nonzero(truth.views.evaluated)), 1)
    counts = (truth.views.evaluated & shown, mine, wrong, lost & ~own & ~others)
    return VisibilityLosses(*(np.count_nonzero(it) / frames for it in counts))


def _met(
    truth: SceneTruth, tracks: Mapping[str, list[MotRow]], person_of: Mapping[int, int]
) -> tuple[Mask, Mask]:
    """Return (K, N) whether visible people had their own number, and whether they had another."""
    own: Mask = np.zeros(truth.views.evaluated.shape, dtype=bool)
    others = own.copy()
    frames = own.shape[1]
    for column, camera in enumerate(truth.cameras):
        for row in tracks[camera]:
            if row.frame > frames:
                continue
            there = truth.views.visible[:, row.frame - 1, column]
            overlap = iou(truth.boxes[:, row.frame - 1, column], np.array(row.box)[None])
            met = there & (np.nan_to_num(overlap) >= LEAST_IOU)
            for person in np.flatnonzero(met):
                mine = person_of.get(row.id) == truth.people[person]
                (own if mine else others)[person, row.frame - 1] = True
    return own, others
