"""Shrinking boxes to the foreground they hold (paper IV.A.2)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Plane

# A box loses at most this share of its width or height on each side: in a group there is always
# somebody's foreground at the border, and alone the scan is never that far off.
_MOST_TRIM = 0.12
# A row or column with less than this share of foreground is outside.
_LEAST_FILL = 0.04


def shrink(boxes: npt.NDArray[np.float64], foreground: Plane, weight: Plane) -> npt.NDArray[np.float64]:
    """Move each side of each box `(K, 4)` in cells inwards to where the foreground begins.

    Sides that lie in ignored cells (`weight` 0) stay.
    """
    fitted = boxes.copy()
    filled = np.where(weight > 0, foreground, 1.0)
    for row, box in enumerate(boxes):
        left, top, right, bottom = (round(edge) for edge in box)
        inside = filled[top:bottom, left:right]
        if inside.size == 0:
            continue
        across, down = inside.mean(axis=0), inside.mean(axis=1)
        fitted[row] += (_trim(across), _trim(down), -_trim(across[::-1]), -_trim(down[::-1]))
    return fitted


def _trim(profile: npt.NDArray[np.float32]) -> int:
    """Give by how many cells the near end of a profile can be cut."""
    most = int(_MOST_TRIM * len(profile))
    full = np.flatnonzero(profile[: most + 1] >= _LEAST_FILL)
    return int(full[0]) if full.size else 0
