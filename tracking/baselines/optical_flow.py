"""Prediction by KLT optical flow of corners (Lucas, Kanade 1981; Shi, Tomasi 1994; Kalal et al., ICPR 2010).

The corners in a box are tracked to the next image and back. The box is moved by the median step of those
that return to their start, and scaled by the median change of the distances between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image, Mask, Plane

_CORNERS = 40
_QUALITY, _MIN_CORNER_DISTANCE = 0.01, 3.0
"""Least quality relative to the best corner; least pixels between two corners."""
_WINDOW, _LEVELS = (11, 11), 3
_MAX_RETURN_ERROR = 1.0
"""Pixels between a corner and its position after tracking forth and back."""
_MIN_CORNERS = 4
"""Tracked corners needed for a prediction."""
_BORDER_SHARE = 0.15
"""Share of a box's width on either side whose corners are ignored: they are mostly background."""
_MAX_GROWTH = 1.1
"""Maximum factor by which a box may grow or shrink between two images."""


@dataclass(slots=True)
class OpticalFlowTarget:
    """State of one target: its box."""

    box: Floats


class OpticalFlow:
    """Moves a box by the median optical flow of its corners."""

    name = "klt"
    uses_image = True

    def __init__(self) -> None:
        self._before: Mask | None = None

    def initialize(self, image: Image, box: Floats) -> OpticalFlowTarget:  # noqa: ARG002 — corners are detected in the next call
        """Create a target; its corners are detected with the next image."""
        return OpticalFlowTarget(box.copy())

    def predict(self, image: Image | None, targets: Sequence[OpticalFlowTarget]) -> Floats:
        """Track the targets' corners: `(N, 4)`, NaN where too few returned to their start."""
        boxes = np.full((len(targets), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        now: Mask = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        before, self._before = self._before, now
        if before is None or before.shape != now.shape:
            return boxes
        for row, target in enumerate(targets):
            moved = _tracked_box(before, now, target.box)
            if moved is not None:
                boxes[row] = target.box = moved
        return boxes

    def update(self, target: OpticalFlowTarget, _detection: Floats) -> Floats:
        """Return the target's box; detections are not used."""
        return target.box


def _tracked_box(before: Mask, now: Mask, box: Floats) -> Floats | None:
    """Return the box `(4,)` moved to the next image, or `None` if too few corners were tracked."""
    mask = np.zeros_like(before)
    inset = _BORDER_SHARE * (box[2] - box[0])
    left, right = round(box[0] + inset), round(box[2] - inset)
    mask[max(round(box[1]), 0) : max(round(box[3]), 0), max(left, 0) : max(right, 0)] = 255
    found = cv2.goodFeaturesToTrack(before, _CORNERS, _QUALITY, _MIN_CORNER_DISTANCE, mask=mask)
    if found is None or len(found) < _MIN_CORNERS:
        return None
    corners = np.asarray(found, dtype=np.float32)
    forward, found_forward = _flow(before, now, corners)
    back, found_back = _flow(now, before, forward)
    start, end = corners[:, 0], forward[:, 0]
    kept = found_forward & found_back & (np.hypot(*(back[:, 0] - start).T) <= _MAX_RETURN_ERROR)
    if np.count_nonzero(kept) < _MIN_CORNERS:
        return None
    start, end = start[kept].astype(np.float64), end[kept].astype(np.float64)
    scale = float(np.clip(_growth(start, end), 1 / _MAX_GROWTH, _MAX_GROWTH))
    middle = (box[:2] + box[2:]) / 2 + np.median(end - start, axis=0)
    half = scale * (box[2:] - box[:2]) / 2
    return np.concatenate([middle - half, middle + half])


def _flow(before: Mask, now: Mask, corners: Plane) -> tuple[Plane, NDArray[np.bool_]]:
    """Track corners `(P, 1, 2)` into the next image: positions, and `(P,)` whether each was found."""
    moved, found, _ = cv2.calcOpticalFlowPyrLK(
        before, now, corners, np.empty(0, dtype=np.float32), winSize=_WINDOW, maxLevel=_LEVELS
    )
    return np.asarray(moved, dtype=np.float32), np.asarray(found)[:, 0] == 1


def _growth(start: Floats, end: Floats) -> float:
    """Return the median ratio of the distances between points `(P, 2)` before and after."""
    first, second = np.triu_indices(len(start), 1)
    distances_before = np.hypot(*(start[first] - start[second]).T)
    distances_after = np.hypot(*(end[first] - end[second]).T)
    apart = distances_before > _MIN_CORNER_DISTANCE
    return float(np.median(distances_after[apart] / distances_before[apart])) if apart.any() else 1.0
