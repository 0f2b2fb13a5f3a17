"""Track termination: duplicates and false new tracks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats, areas, intersections, iou
from tracking.model.object_state import TrackedObject

Bools = npt.NDArray[np.bool_]

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
    if not ids:
        return []
    tracks = np.stack(boxes)
    visible = ~np.isnan(tracks[:, :, 0])
    tracks[~visible] = 0.0
    return [
        number
        for n, number in enumerate(ids)
        if _is_duplicate(tracks[:n], visible[:n], tracks[n], visible[n], duplicate_overlap)
    ]


def _is_duplicate(older: Floats, seen: Bools, younger: Floats, visible: Bools, overlap: float) -> bool:
    """Return whether a track `(F, 4)` duplicates one of `older` `(T, F, 4)`; boxes are 0 where hidden."""
    common = (seen & visible).sum(axis=1)
    candidates = common >= max(_MIN_COMMON_FRAMES, _MIN_COMMON_SHARE * np.count_nonzero(visible))
    older, common = older[candidates], common[candidates]
    smaller = np.maximum(np.minimum(areas(older), areas(younger)), 1.0)
    inside = (intersections(older, younger) / smaller).sum(axis=1) / common
    shared = iou(older, younger).sum(axis=1) / common
    return bool(((shared >= overlap) | (inside >= (1.0 + overlap) / 2.0 + 0.1)).any())


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
