"""Non-maximum suppression of boxes."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats, heights, widths


def non_maximum_suppression(boxes: Floats, scores: Floats, apart: float, most: int) -> npt.NDArray[np.int64]:
    """Return the indices of the boxes `(N, 4)` left by non-maximum suppression at IoU `apart`, best first.

    At most `most` of them. Of equal scores the leftmost, then the topmost comes first, so that the answer
    does not depend on the order in which the boxes came.
    """
    order = np.lexsort((boxes[:, 3], boxes[:, 1], boxes[:, 0], -scores))
    if not order.size:
        return order
    ranked = boxes[order]
    sides = np.stack([ranked[:, 0], ranked[:, 1], widths(ranked), heights(ranked)], axis=1)
    # By rank, not by score: OpenCV's own order of equal scores is not ours.
    ranks = np.linspace(1.0, 0.5, len(order))
    kept = cv2.dnn.NMSBoxes(sides.tolist(), ranks.tolist(), 0.0, apart)
    return order[np.sort(np.asarray(kept, dtype=np.int64))[:most]]
