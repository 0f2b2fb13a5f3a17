"""Views that show somebody as far as is known from elsewhere, beside those that are found or missed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.view_selection.sparse_costs import VisibleViews

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def add_inferred_views(
    views: VisibleViews, frame: Ints, camera: Ints, person: Ints, worth: Floats
) -> VisibleViews:
    """Add V views that are expected to show somebody; where a view is only taken to, the larger worth counts.

    Args:
        views: those found, and then those that are only taken to be there.
        frame: (V,) of each; none is found, or cannot be shown.
        camera: (V,).
        person: (V,).
        worth: (V,) in [0, 1].
    """
    if not len(frame):
        return views
    cameras, found = (
        views.available.shape[1],
        len(views.frame) if views.detected_count is None else views.detected_count,
    )

    def cells(frame: Ints, camera: Ints, person: Ints) -> Ints:
        return np.asarray((frame * cameras + camera) * views.person_count + person)

    best = np.zeros(views.available.size * views.person_count)
    best[cells(frame, camera, person)] = worth
    taken = slice(found, None)
    missed = cells(views.frame[taken], views.camera[taken], views.person[taken])
    best[missed] = np.maximum(best[missed], views.quality[taken])
    cell = np.flatnonzero(best)
    moment, of = np.divmod(cell, views.person_count)
    return VisibleViews(
        np.concatenate([views.frame[:found], moment // cameras]),
        np.concatenate([views.camera[:found], moment % cameras]),
        np.concatenate([views.person[:found], of]),
        np.concatenate([views.quality[:found], best[cell]]),
        views.available,
        views.person_count,
        detected_count=found,
    )
