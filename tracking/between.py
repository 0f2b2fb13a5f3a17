"""What was probably there in a frame that nobody looked at, between two that were: not in the paper."""

from __future__ import annotations

import numpy as np

from tracking.boxes import iou
from tracking.detections import Detections

_SAME = 0.2
"""Overlap (IoU) of two boxes at least that are taken for the same thing a few frames later."""


def between(before: Detections, after: Detections, share: float) -> Detections:
    """Give the detections of a frame that lies `share` of the way from one searched frame to the next.

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
    kept = rows[(back[nearest] == rows) & (alike[rows, nearest] >= _SAME)]
    matched = nearest[kept]
    return Detections(
        (1.0 - share) * before.boxes[matched] + share * after.boxes[kept],
        np.minimum(before.scores[matched], after.scores[kept]),
        after.histograms[kept],
    )
