"""Two tracks on one person: the younger one goes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats, areas, intersections, iou
from tracking.model.object_state import RememberedObject

# Frames in which both must be seen: a crossing is short.
_LEAST_TOGETHER = 5
# Share of the younger one's visible frames in which the older one must be there too.
_LEAST_SHARE = 0.7


def duplicates(ids: Sequence[int], boxes: Sequence[Floats], overlap: float) -> list[int]:
    """Give the ids of tracks that follow what an older track follows, ascending.

    Args:
        ids: ascending ids.
        boxes: of each track, `(F, 4)` with NaN rows where it is hidden.
        overlap: mean overlap from which two tracks are one: the intersection over the union, or over
            the smaller box, a bit more.
    """
    gone: list[int] = []
    for younger in range(len(ids) - 1, 0, -1):
        for older in range(younger):
            if ids[older] not in gone and _same(boxes[older], boxes[younger], overlap):
                gone.append(ids[younger])
                break
    return sorted(gone)


def _same(older: Floats, younger: Floats, overlap: float) -> bool:
    here = ~np.isnan(younger[:, 0])
    both = here & ~np.isnan(older[:, 0])
    together = np.count_nonzero(both)
    if together < max(_LEAST_TOGETHER, _LEAST_SHARE * np.count_nonzero(here)):
        return False
    one, two = older[both], younger[both]
    smaller = np.maximum(np.minimum(areas(one), areas(two)), 1.0)
    inside = float(np.mean(intersections(one, two) / smaller))
    return float(np.mean(iou(one, two))) >= overlap or inside >= (1.0 + overlap) / 2.0 + 0.1


_LEAST_SEEN = 3
"""A new object that is on so few of the window's frames once all are solved together was none."""


def ended(objects: Sequence[RememberedObject], boxes: Sequence[Floats], duplicate: float) -> set[int]:
    """Give the ids that end with this window: a second track on somebody, a new one that was none.

    `boxes` are everybody's, `(F, 4)` with NaN rows where hidden; `duplicate` as in `duplicates`.
    """
    gone = set(duplicates([item.id for item in objects], boxes, duplicate))
    for item, rows in zip(objects, boxes, strict=True):
        if not item.confirmed and np.count_nonzero(~np.isnan(rows[:, 0])) < _LEAST_SEEN:
            gone.add(item.id)
    return gone
