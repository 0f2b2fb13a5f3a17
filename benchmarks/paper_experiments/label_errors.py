"""Errors of labels against the ground truth, which the paper counts by eye (IV.A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from benchmarks.paper_experiments.scene import ExperimentScene, ObjectTruth
from tracking.boxes import Floats, iou

_ON = 0.3
"""Least overlap (IoU) of a label's box with its object: looser than in an evaluation."""
_FOUND = 0.5
"""Least overlap (IoU) of an observation with the object that it detects."""
_IN_VIEW = 0.5
"""Visible share of an object from which its label must not be missing."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class LabelErrors:
    """The errors of the labels of n objects in T frames, each `(n, T)`.

    Attributes:
        wrong: the label is on another object, or on nothing: its box hardly overlaps its own object, or
            overlaps another one more.
        unlike: of these, the label is on nothing or on an object of another kit.
        missing: the object is in view and was detected, but has no label.
    """

    wrong: Bools
    unlike: Bools
    missing: Bools


def per_frame(labels: Bools) -> float:
    """Return the mean number of marked labels `(n, T)` per frame, as the paper counts."""
    return float(labels.sum() / labels.shape[1])


def judge(scene: ExperimentScene, boxes: Floats) -> LabelErrors:
    """Find the errors of the labels' boxes, `(n, T, 4)`, NaN: no label."""
    truth = scene.truth
    whose = _whose(truth, boxes)
    shown = ~np.isnan(boxes[..., 0])
    own = np.arange(truth.objects)[:, None]
    findable = np.array(
        [[_found(scene, k, t) for t in range(truth.frames)] for k in range(truth.objects)], dtype=np.bool_
    )
    in_view = truth.visible >= _IN_VIEW
    wrong = shown & (whose != own)
    kits = np.array([*scene.kits, -1])
    return LabelErrors(wrong, wrong & (kits[whose] != kits[own]), ~shown & in_view & findable)


def _whose(truth: ObjectTruth, boxes: Floats) -> NDArray[np.int64]:
    """Return the object that each label's box is on, `(n, T)`; -1: none. Ties go to its own object."""
    overlaps = np.nan_to_num(iou(boxes[:, None], truth.boxes[None]))
    own = np.arange(len(boxes))
    overlaps[own, own] += 1e-9
    best = overlaps.argmax(axis=1)
    return np.asarray(np.where(overlaps.max(axis=1) >= _ON, best, -1))


def _found(scene: ExperimentScene, k: int, t: int) -> bool:
    """Return whether an object was detected."""
    if np.isnan(scene.truth.boxes[k, t, 0]):
        return False
    seen = scene.seen[k if len(scene.seen) > 1 else 0][t]
    return bool((iou(scene.truth.boxes[k, t], seen.boxes) >= _FOUND).any())


def named(truth: ObjectTruth, tracks: dict[int, Floats]) -> Floats:
    """Return the track that follows each object longest, `(n, T, 4)`, for objects without templates.

    The assignment is one to one; an object without a track has no label.
    """
    boxes = np.full_like(truth.boxes, np.nan)
    numbers = sorted(tracks)
    if not numbers:
        return boxes
    on = np.array(
        [(np.nan_to_num(iou(tracks[number][None], truth.boxes)) >= _ON).sum(axis=1) for number in numbers]
    )
    for row, k in zip(*linear_sum_assignment(-on), strict=True):
        boxes[k] = tracks[numbers[row]]
    return boxes
