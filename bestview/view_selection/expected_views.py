"""Views inferred from other cameras, added to the detected and missed ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.view_selection.sparse_costs import VisibleViews

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def add_inferred_views(
    views: VisibleViews, frame: Ints, camera: Ints, person: Ints, quality: Floats
) -> VisibleViews:
    """Add V inferred views; where a view was already inferred, the larger quality counts.

    Args:
        views: detected ones, and then inferred ones.
        frame: (V,) of each; the camera does not detect the person, and can be shown.
        camera: (V,).
        person: (V,).
        quality: (V,) in [0, 1].
    """
    if not len(frame):
        return views
    cameras, detected = (
        views.available.shape[1],
        len(views.frame) if views.detected_count is None else views.detected_count,
    )

    def cells(frame: Ints, camera: Ints, person: Ints) -> Ints:
        return np.asarray((frame * cameras + camera) * views.person_count + person)

    best = np.zeros(views.available.size * views.person_count)
    best[cells(frame, camera, person)] = quality
    inferred = slice(detected, None)
    missed = cells(views.frame[inferred], views.camera[inferred], views.person[inferred])
    best[missed] = np.maximum(best[missed], views.quality[inferred])
    cell = np.flatnonzero(best)
    moment, person_index = np.divmod(cell, views.person_count)
    return VisibleViews(
        np.concatenate([views.frame[:detected], moment // cameras]),
        np.concatenate([views.camera[:detected], moment % cameras]),
        np.concatenate([views.person[:detected], person_index]),
        np.concatenate([views.quality[:detected], best[cell]]),
        views.available,
        views.person_count,
        detected_count=detected,
    )
