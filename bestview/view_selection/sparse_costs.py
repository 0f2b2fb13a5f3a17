"""GOP costs from a sparse list of views, since most cameras do not see most people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.view_selection.dynamic_program import NO_VIEW_COST, GopCosts

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class VisibleViews:
    """R views that show a person, of K people in N frames of C cameras. All other views have quality 0.

    There is at most one view of a camera and person in a frame.

    Attributes:
        frame: (R,) 0 to N - 1.
        camera: (R,) by index.
        person: (R,) by index.
        quality: (R,) above 0, at most 1: a view costs ``1 - quality``.
        available: (N, C) where a camera's frame can be shown at all; there are no views elsewhere.
        person_count: K.
        detected_count: the first so many are detected, the others inferred; None: all are detected.
    """

    frame: Ints
    camera: Ints
    person: Ints
    quality: Floats
    available: NDArray[np.bool_]
    person_count: int
    detected_count: int | None = None

    def gops(self, first: int, starts: NDArray[np.bool_], weight: Floats, *, mark_hidden: bool) -> GopCosts:
        """Sum the costs over the GOPs of a window.

        A GOP costs ``sum of w(n) - sum of w(n) quality(n)``, each sum view after view; infinitely much if the
        camera cannot be shown in all of it.

        Args:
            first: frame at which the window starts, which is the first of a GOP.
            starts: (M,) where GOPs start in the window; the first entry is true.
            weight: (M,) number of frames that each frame stands for.
            mark_hidden: whether to mark where a camera is known not to show the person.
        """
        frames, cameras = len(weight), self.available.shape[1]
        gop = np.cumsum(starts) - 1
        count = int(gop[-1]) + 1
        rows = np.flatnonzero((self.frame >= first) & (self.frame < first + frames))
        offset = self.frame[rows] - first
        cell = (gop[offset] * cameras + self.camera[rows]) * self.person_count + self.person[rows]
        cells = count * cameras * self.person_count
        # bincount adds row by row, so no sum depends on the number of other rows.
        gained = np.bincount(cell, self.quality[rows] * weight[offset], cells).reshape(
            count, cameras, self.person_count
        )
        frame_weights: Floats = np.bincount(gop, weight).astype(np.float64)
        cost = NO_VIEW_COST * frame_weights[:, None, None] - gained
        unavailable = ~np.logical_and.reduceat(
            self.available[first : first + frames], np.flatnonzero(starts), axis=0
        )
        cost[unavailable] = np.inf
        if not mark_hidden:
            return GopCosts(list(cost), frame_weights, [None] * count)
        detected = cell if self.detected_count is None else cell[rows < self.detected_count]
        hidden = np.bincount(detected, minlength=cells).reshape(cost.shape) == 0
        return GopCosts(list(cost), frame_weights, list(hidden | unavailable[:, :, None]))
