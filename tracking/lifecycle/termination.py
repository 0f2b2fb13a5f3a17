"""Track termination: duplicates and false new tracks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats, areas, intersections, iou
from tracking.model.object_state import TrackedObject

# Least frames in which both tracks are visible: crossings are shorter.
_MIN_COMMON_FRAMES = 5
# Least share of the younger track's visible frames in which the older one is visible, too.
_MIN_COMMON_SHARE = 0.7


def duplicate_ids(ids: Sequence[int], boxes: Sequence[Floats], duplicate_overlap: float) -> list[int]:
    """Return the ids of tracks that duplicate an older track, ascending.

    Args:
        ids: ascending ids.
        boxes: for each track `(F, 4)`, NaN where it is occluded.
        duplicate_overlap: mean IoU from which two tracks are duplicates; of the intersection over the smaller
            box a slightly larger mean is required.
    """
    ended: list[int] = []
    for younger in range(len(ids) - 1, 0, -1):
        for older in range(younger):
            if ids[older] not in ended and _is_duplicate(boxes[older], boxes[younger], duplicate_overlap):
                ended.append(ids[younger])
                break
    return sorted(ended)


def _is_duplicate(older: Floats, younger: Floats, overlap: float) -> bool:
    visible = ~np.isnan(younger[:, 0])
    both = visible & ~np.isnan(older[:, 0])
    common = np.count_nonzero(both)
    if common < max(_MIN_COMMON_FRAMES, _MIN_COMMON_SHARE * np.count_nonzero(visible)):
        return False
    first, second = older[both], younger[both]
    smaller = np.maximum(np.minimum(areas(first), areas(second)), 1.0)
    inside = float(np.mean(intersections(first, second) / smaller))
    return float(np.mean(iou(first, second))) >= overlap or inside >= (1.0 + overlap) / 2.0 + 0.1


_MIN_VISIBLE_FRAMES = 3
"""Least visible frames of a new object in the window's joint solution; with fewer it is dropped."""


def terminated_ids(
    objects: Sequence[TrackedObject], boxes: Sequence[Floats], duplicate_overlap: float
) -> set[int]:
    """Return the ids that end with this window: duplicates and unconfirmed tracks.

    `boxes` are those of each object, `(F, 4)`, NaN where occluded; `duplicate_overlap` is as in
    `duplicate_ids`.
    """
    ended = set(duplicate_ids([item.id for item in objects], boxes, duplicate_overlap))
    for item, rows in zip(objects, boxes, strict=True):
        if not item.is_confirmed and np.count_nonzero(~np.isnan(rows[:, 0])) < _MIN_VISIBLE_FRAMES:
            ended.add(item.id)
    return ended
