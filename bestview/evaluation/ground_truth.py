"""Ground truth of view quality, and the matching of published objects with ground-truth people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from bestview.quality import relative_quality, size_quality, view_cost
from bestview.view_selection import NO_CAMERA, select_views

NO_PERSON = -1


@dataclass(frozen=True, slots=True, eq=False)
class ViewGroundTruth:
    """True quality of every view of K people, N frames, C cameras.

    Attributes:
        cost: (K, N, C) float64, view cost in [0, 1]: 1 minus the view's size quality over that of the best
            view; 1 where the person is not visible.
        visible: (K, N, C) bool, where the person really is visible.
    """

    cost: NDArray[np.float64]
    visible: NDArray[np.bool_]

    @property
    def evaluated(self) -> NDArray[np.bool_]:
        """(K, N) frames that are evaluated: those in which some camera could show the person."""
        return np.asarray(self.visible.any(axis=2))


def view_ground_truth(
    boxes: NDArray[np.float64],
    visible_share: NDArray[np.float64],
    sizes: NDArray[np.float64],
    minimum_visible_share: float,
) -> ViewGroundTruth:
    """Derive the quality of every view from ground truth.

    A person is visible in a camera if they have a box there of which `minimum_visible_share` or more shows.
    The largest such view has quality 1, and the others are divided by it.

    Args:
        boxes: (K, N, C, 4) left, top, right, bottom in pixels of the camera's picture; NaN: no box.
        visible_share: (K, N, C) of each person, in [0, 1]; negative where it is not known,
            which counts as all of it.
        sizes: (C, 2) width and height of each camera's picture, pixels.
        minimum_visible_share: in [0, 1]; 0: everyone with a box is visible.

    Raises:
        ValueError: shapes that do not fit, or a picture without area.
    """
    if boxes.ndim != 4 or visible_share.shape != boxes.shape[:3] or sizes.shape != (boxes.shape[2], 2):  # noqa: PLR2004
        raise ValueError(
            f"shapes do not fit: boxes {boxes.shape}, shares {visible_share.shape}, sizes {sizes.shape}"
        )
    quality = np.zeros(visible_share.shape)
    for camera, (width, height) in enumerate(sizes.tolist()):
        quality[:, :, camera] = size_quality(boxes[:, :, camera], width, height)
    visible = (quality > 0.0) & ((visible_share < 0.0) | (visible_share >= minimum_visible_share))
    return ViewGroundTruth(view_cost(relative_quality(np.where(visible, quality, 0.0), axis=2)), visible)


def optimal_views(truth: ViewGroundTruth, switch_cost: float) -> NDArray[np.int64]:
    """Compute the exact offline optimum of section III: the whole recording is known, every cut is allowed.

    Frames that are not evaluated are left out; the frames around such a gap count as neighbors.

    Returns:
        (K, N) camera indices; -1 in frames that are not evaluated.

    Raises:
        ValueError: the switching cost is negative, or no number.
    """
    views = np.full(truth.visible.shape[:2], NO_CAMERA, dtype=np.int64)
    for person_views, evaluated, cost in zip(views, truth.evaluated, truth.cost, strict=True):
        frames = int(np.count_nonzero(evaluated))
        anywhere = np.ones(frames, dtype=bool)
        person_views[evaluated] = select_views(
            cost[None, evaluated], _NO_PREVIOUS_VIEW, switch_cost, anywhere
        ).views[0]
    return views


_NO_PREVIOUS_VIEW = np.array([NO_CAMERA])


def assign_objects_one_to_one(matches: NDArray[np.int64]) -> NDArray[np.int64]:
    """Assign each object to one person and each person to one object, with the largest total of matches.

    As for IDF1 (Ristani et al., 2016), over all cameras together.

    Args:
        matches: (K, O) number of frames of all cameras in which each of K people was at each of O objects'
            boxes.

    Returns:
        (O,) the index of each object's person; -1: none.

    Raises:
        ValueError: `matches` is not two-dimensional.
    """
    if matches.ndim != 2:  # noqa: PLR2004 — people, objects
        raise ValueError(f"matches have shape {matches.shape}, not (people, objects)")
    people = np.full(matches.shape[1], NO_PERSON, dtype=np.int64)
    rows, columns = scipy.optimize.linear_sum_assignment(matches, maximize=True)
    matched = matches[rows, columns] > 0
    people[columns[matched]] = rows[matched]
    return people
