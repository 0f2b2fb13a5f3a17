"""Where somebody is while hidden for a moment: on the straight line from sighting to sighting."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tracking.boxes import Floats


def bridged(boxes: Floats, last: tuple[int, Floats] | None, most: int) -> Floats:
    """Give the boxes (F, 4) of a window with short gaps filled, (F, 4).

    Args:
        boxes: NaN where the object is hidden.
        last: the frame, counted from the window's first (negative), and the box (4,) of the last sighting
            before the window; None: there is none.
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
