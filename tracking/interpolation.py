"""Linear interpolation of short occlusions and skipped frames."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tracking.boxes import Floats, iou
from tracking.types import Detections


def interpolate_gaps(boxes: Floats, last: tuple[int, Floats] | None, max_gap: int) -> Floats:
    """Return the boxes (F, 4) of a window with short gaps filled, (F, 4).

    Args:
        boxes: (F, 4), NaN where the object is occluded.
        last: frame relative to the window's first (negative) and box (4,) of the last detection before the
            window; None: none.
        max_gap: frames of the longest gap that is filled.
    """
    filled = boxes.copy()
    visible = [(int(m), boxes[m]) for m in np.flatnonzero(~np.isnan(boxes[:, 0]))]
    if last is not None:
        visible.insert(0, last)
    for (before, start), (after, end) in pairwise(visible):
        if 0 < after - before - 1 <= max_gap:
            gap = np.arange(max(before + 1, 0), after)
            share = ((gap - before) / (after - before))[:, None]
            filled[gap] = (1.0 - share) * start + share * end
    return filled


_MIN_MATCH_IOU = 0.2
"""Least overlap (IoU) of two boxes, a few frames apart, that count as the same object."""


def interpolate_detections(before: Detections, after: Detections, share: float) -> Detections:
    """Return the detections of a frame that lies `share` of the way from one searched frame to the next.

    Boxes of the two frames that mutually overlap most are matched and interpolated linearly; the score is the
    lower of the two, and the appearance that of the later frame. Unmatched boxes are left out. The order is
    that of the later frame.

    Args:
        before: (K,) detections of the earlier searched frame.
        after: (L,) detections of the later one.
        share: position between the two, in [0, 1].
    """
    if not len(before) or not len(after):
        return Detections.empty(after.histograms.shape[1])
    overlaps = iou(after.boxes[:, None], before.boxes[None])
    nearest, back = overlaps.argmax(axis=1), overlaps.argmax(axis=0)
    rows = np.arange(len(after))
    kept = rows[(back[nearest] == rows) & (overlaps[rows, nearest] >= _MIN_MATCH_IOU)]
    matched = nearest[kept]
    return Detections(
        (1.0 - share) * before.boxes[matched] + share * after.boxes[kept],
        np.minimum(before.scores[matched], after.scores[kept]),
        after.histograms[kept],
    )
