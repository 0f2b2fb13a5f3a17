"""Counting wrong labels against the truth, as the paper does by eye (IV.A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from benchmarks.paper_experiments.scene import ExperimentScene, ObjectTruth
from tracking.boxes import Floats, iou

_ON = 0.3
"""Least overlap (IoU) of a label's box with its object: looser than an evaluation, as an eye is."""
_FOUND = 0.5
"""Least overlap of an observation that the label has to be on."""
_IN_VIEW = 0.5
"""Least visible share of an object whose label must not be missing."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class LabelErrors:
    """What is wrong with the labels of n objects in T frames, each `(n, T)`.

    Attributes:
        wrong: the label is on somebody else, or on nothing: its box hardly overlaps its own object, or
            another one more.
        unlike: of these, the label is on nothing or on somebody who does not look like its object: no two
            of one kit have changed names.
        missing: the object is in view and was found by the detector, and its label is nowhere.
    """

    wrong: Bools
    unlike: Bools
    missing: Bools


def per_frame(labels: Bools) -> float:
    """Return how many of the labels of all objects, `(n, T)`, are marked in a frame, as the paper counts."""
    return float(labels.sum() / labels.shape[1])


def judge(scene: ExperimentScene, boxes: Floats) -> LabelErrors:
    """Judge the labels' boxes, `(n, T, 4)`, NaN where a label is nowhere."""
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
    """Return the object that each label's box is on, `(n, T)`; -1: on none. Of equals, the label's own."""
    overlaps = np.nan_to_num(iou(boxes[:, None], truth.boxes[None]))
    own = np.arange(len(boxes))
    overlaps[own, own] += 1e-9
    best = overlaps.argmax(axis=1)
    return np.asarray(np.where(overlaps.max(axis=1) >= _ON, best, -1))


def _found(scene: ExperimentScene, k: int, t: int) -> bool:
    """Return whether the detector found an object."""
    if np.isnan(scene.truth.boxes[k, t, 0]):
        return False
    seen = scene.seen[k if len(scene.seen) > 1 else 0][t]
    return bool((iou(scene.truth.boxes[k, t], seen.boxes) >= _FOUND).any())


def named(truth: ObjectTruth, tracks: dict[int, Floats]) -> Floats:
    """Return each object the track that follows it longest, `(n, T, 4)`: for objects that had to be found.

    One track for each object and one object for each track; an object left without has no label.
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
