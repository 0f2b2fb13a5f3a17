"""Linear interpolation of short occlusions and skipped frames."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tracking.boxes import Floats, iou
from tracking.types import Detections


def interpolate_gaps(boxes: Floats, last: tuple[int, Floats] | None, most: int) -> Floats:
    """Return the boxes (F, 4) of a window with short gaps filled, (F, 4).

    Args:
        boxes: NaN where the object is hidden.
        last: the frame, counted from the window's first (negative), and the box (4,) of the last sighting
            before the window; None: none.
        most: frames of the longest gap that is filled.
    """
    filled = boxes.copy()
    seen = [(int(m), boxes[m]) for m in np.flatnonzero(~np.isnan(boxes[:, 0]))]
    if last is not None:
        seen.insert(0, last)
    for (before, start), (after, end) in pairwise(seen):
        if after - before - 1 <= most:
            hidden = np.arange(max(before + 1, 0), after)
            share = ((hidden - before) / (after - before))[:, None]
            filled[hidden] = (1.0 - share) * start + share * end
    return filled


_MIN_MATCH_IOU = 0.2
"""Overlap (IoU) of two boxes at least that are taken for the same thing a few frames later."""


def interpolate_detections(before: Detections, after: Detections, share: float) -> Detections:
    """Return the detections of a frame that lies `share` of the way from one searched frame to the next.

    Boxes of the two frames that overlap each other most are the same thing, which went straight from one to
    the other; its score is the lower of the two, and it looks as in the later frame. What has no such box in
    the other frame is left out. They come in the order of the later frame.

    Args:
        before: (K,) of the frame before.
        after: (L,) of the frame after it.
        share: in [0, 1].
    """
    if not len(before) or not len(after):
        return Detections.empty(after.histograms.shape[1])
    alike = iou(after.boxes[:, None], before.boxes[None])
    nearest, back = alike.argmax(axis=1), alike.argmax(axis=0)
    rows = np.arange(len(after))
    kept = rows[(back[nearest] == rows) & (alike[rows, nearest] >= _MIN_MATCH_IOU)]
    matched = nearest[kept]
    return Detections(
        (1.0 - share) * before.boxes[matched] + share * after.boxes[kept],
        np.minimum(before.scores[matched], after.scores[kept]),
        after.histograms[kept],
    )
