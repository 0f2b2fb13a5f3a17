"""Track termination: duplicates and false new tracks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats, areas, intersections, iou
from tracking.model.object_state import TrackedObject

# Frames in which both must be seen: a crossing is short.
_MIN_COMMON_FRAMES = 5
# Share of the younger one's visible frames in which the older one must be there too.
_MIN_COMMON_SHARE = 0.7


def duplicate_ids(ids: Sequence[int], boxes: Sequence[Floats], overlap: float) -> list[int]:
    """Return the ids of tracks that follow what an older track follows, ascending.

    Args:
        ids: ascending ids.
        boxes: of each track, `(F, 4)` with NaN rows where it is hidden.
        overlap: mean overlap from which two tracks are one: the intersection over the union, or over
            the smaller box, a bit more.
    """
    gone: list[int] = []
    for younger in range(len(ids) - 1, 0, -1):
        for older in range(younger):
            if ids[older] not in gone and _is_duplicate(boxes[older], boxes[younger], overlap):
                gone.append(ids[younger])
                break
    return sorted(gone)


def _is_duplicate(older: Floats, younger: Floats, overlap: float) -> bool:
    here = ~np.isnan(younger[:, 0])
    both = here & ~np.isnan(older[:, 0])
    together = np.count_nonzero(both)
    if together < max(_MIN_COMMON_FRAMES, _MIN_COMMON_SHARE * np.count_nonzero(here)):
        return False
    one, two = older[both], younger[both]
    smaller = np.maximum(np.minimum(areas(one), areas(two)), 1.0)
    inside = float(np.mean(intersections(one, two) / smaller))
    return float(np.mean(iou(one, two))) >= overlap or inside >= (1.0 + overlap) / 2.0 + 0.1


_MIN_VISIBLE_FRAMES = 3
"""A new object that is on so few of the window's frames once all are solved together was none."""


def terminated_ids(objects: Sequence[TrackedObject], boxes: Sequence[Floats], duplicate: float) -> set[int]:
    """Return the ids that end with this window: a second track on somebody, a new one that was none.

    `boxes` are everybody's, `(F, 4)` with NaN rows where hidden; `duplicate` as in `duplicate_ids`.
    """
    gone = set(duplicate_ids([item.id for item in objects], boxes, duplicate))
    for item, rows in zip(objects, boxes, strict=True):
        if not item.is_confirmed and np.count_nonzero(~np.isnan(rows[:, 0])) < _MIN_VISIBLE_FRAMES:
            gone.add(item.id)
    return gone
