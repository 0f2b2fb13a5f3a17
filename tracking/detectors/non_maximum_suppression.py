"""Non-maximum suppression of boxes."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats, heights, widths


def non_maximum_suppression(
    boxes: Floats, scores: Floats, max_iou: float, max_boxes: int
) -> npt.NDArray[np.int64]:
    """Return the indices of at most `max_boxes` boxes `(N, 4)` that overlap by at most `max_iou`, best first.

    Equal scores are ordered by left, then by top, so that the result does not depend on the order of the
    input.
    """
    order = np.lexsort((boxes[:, 3], boxes[:, 1], boxes[:, 0], -scores))
    if not order.size:
        return order
    ranked = boxes[order]
    sides = np.stack([ranked[:, 0], ranked[:, 1], widths(ranked), heights(ranked)], axis=1)
    # Ranks instead of scores: OpenCV orders equal scores differently.
    ranks = np.linspace(1.0, 0.5, len(order))
    kept = cv2.dnn.NMSBoxes(sides.tolist(), ranks.tolist(), 0.0, max_iou)
    return order[np.sort(np.asarray(kept, dtype=np.int64))[:max_boxes]]
