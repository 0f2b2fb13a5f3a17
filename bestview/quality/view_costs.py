"""View costs c(n, b) of section III, from view qualities."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.quality.framing import Floats

HIDDEN_COST = 1.0
"""View cost of a camera that runs but does not show the object."""


def view_cost(quality: Floats) -> Floats:
    """Return the cost ``1 - quality`` of section III for qualities in [0, 1]; hidden (quality 0) costs 1."""
    return np.asarray(HIDDEN_COST - np.clip(quality, 0.0, 1.0))


def relative_quality(quality: Floats, axis: int) -> Floats:
    """Divide each view's quality by that of the best view of the same object in the same frame.

    The best view then has quality 1 however far away the person is, and the cost ``1 - quality`` is the share
    of it that is lost: a cut has the same price in a narrow room and on a wide square.

    Args:
        quality: in [0, 1]; 0 where hidden.
        axis: the cameras'.

    Returns:
        The same shape, in [0, 1]; 0 where no view shows the object.
    """
    best = quality.max(axis=axis, keepdims=True)
    return np.asarray(quality / np.where(best > 0, best, 1.0))


def relative_view_quality(quality: Floats, moment: NDArray[np.int64], moments: int) -> Floats:
    """Divide each view's quality by that of the best view, for a list of views.

    Args:
        quality: (R,) of views, in [0, 1].
        moment: (R,) object and frame of each view, as one number from 0 to `moments` - 1.
        moments: how many there are.

    Returns:
        (R,) in [0, 1].
    """
    best = np.zeros(moments)
    np.maximum.at(best, moment, quality)
    best_quality = best[moment]
    return np.asarray(quality / np.where(best_quality > 0, best_quality, 1.0))
