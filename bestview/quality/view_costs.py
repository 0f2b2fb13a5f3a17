"""From qualities to the view costs c(n, b) of section III."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.quality.boxes import Floats

HIDDEN_COST = 1.0
"""The view cost of a camera that runs but does not see the object."""


def view_cost(quality: Floats) -> Floats:
    """Turn quality in [0, 1] into the cost ``1 - quality`` of section III; hidden (quality 0) costs 1."""
    return np.asarray(HIDDEN_COST - np.clip(quality, 0.0, 1.0))


def relative_quality(quality: Floats, axis: int) -> Floats:
    """Divide each view's quality by that of the best view of the same object in the same frame.

    The best view is then worth 1 however far away everybody is, and the cost ``1 - quality`` says which share
    of it is lost: the same cut is worth its price in a narrow room and on a wide square.

    Args:
        quality: in [0, 1]; 0 where hidden.
        axis: the cameras'.

    Returns:
        The same shape, in [0, 1]; 0 where nobody sees the object.
    """
    best = quality.max(axis=axis, keepdims=True)
    return np.asarray(quality / np.where(best > 0, best, 1.0))


def relative_view_quality(quality: Floats, moment: NDArray[np.int64], moments: int) -> Floats:
    """Do the same for a list of views.

    Args:
        quality: (R,) of views, in [0, 1].
        moment: (R,) object and frame of each view, as one number from 0 to `moments` - 1.
        moments: how many there are.

    Returns:
        (R,) in [0, 1].
    """
    best = np.zeros(moments)
    np.maximum.at(best, moment, quality)
    of = best[moment]
    return np.asarray(quality / np.where(of > 0, of, 1.0))
