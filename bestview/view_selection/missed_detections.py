"""People whom a camera misses for a moment: found views are not all there are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.view_selection.sparse_costs import VisibleViews

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class LastDetections:
    """How each camera saw each person last before frame 0, C cameras and K people.

    Attributes:
        age: (C, K) frames before frame 0, at least 1; infinite: never, as far as is known.
        quality: (C, K) of that view.
    """

    age: Floats
    quality: Floats

    def advanced_to(self, views: VisibleViews, frames: int) -> LastDetections:
        """Give the same before frame `frames`, those views seen that are before it."""
        ago, worth = self.age + frames, self.quality.copy()
        rows = np.flatnonzero(views.frame < frames)
        at = views.camera[rows], views.person[rows]
        # Later frames come later, and what is written last stays.
        ago[at], worth[at] = frames - views.frame[rows], views.quality[rows]
        return LastDetections(ago, worth)


def add_missed_detections(views: VisibleViews, last: LastDetections, lasts: float) -> VisibleViews:
    """Take who is not found any more to be still there, less and less.

    *n* frames after the last view a view is worth ``1 - n / lasts`` of it, until the camera finds the person
    again or that is nothing. Detectors miss people for moments, and two cuts for that are two too many.

    Args:
        views: those that were found.
        last: what was found before.
        lasts: frames, 0 or more.

    Returns:
        The views found, and then those missed, each of them rising by frame for a camera and person.
    """
    (frames, cameras), people = views.available.shape, views.person_count
    if not frames or lasts <= 1.0:
        return views
    cell = views.camera * people + views.person
    found = np.zeros((frames, cameras * people), dtype=np.bool_)
    found[views.frame, cell] = True
    at_start = np.flatnonzero((last.age.reshape(-1) < lasts) & ~found[0])
    ends, of = np.divmod(np.flatnonzero(found[:-1] & ~found[1:]), cameras * people)
    row = np.empty(found.shape, dtype=np.int32)
    row[views.frame, cell] = np.arange(len(cell), dtype=np.int32)
    cells = np.concatenate([at_start, of])
    seen = np.concatenate([-last.age.reshape(-1)[at_start], ends])
    worth = np.concatenate([last.quality.reshape(-1)[at_start], views.quality[row[ends, of]]])
    begin = np.concatenate([np.zeros(len(at_start), dtype=np.int64), ends + 1])
    again = found[:, cells] & (np.arange(frames)[:, None] >= begin)
    until = np.where(again.any(axis=0), again.argmax(axis=0), frames)
    until = np.minimum(until, np.ceil(seen + lasts).astype(np.int64))
    count = np.maximum(until - begin, 0)
    gap = np.repeat(np.arange(len(cells)), count)
    frame = np.arange(len(gap)) + np.repeat(begin - (np.cumsum(count) - count), count)
    left = worth[gap] * (1.0 - (frame - seen[gap]) / lasts)
    camera, person = np.divmod(cells[gap], people)
    there = (left > 0.0) & views.available[frame, camera]
    return VisibleViews(
        np.concatenate([views.frame, frame[there]]),
        np.concatenate([views.camera, camera[there]]),
        np.concatenate([views.person, person[there]]),
        np.concatenate([views.quality, left[there]]),
        views.available,
        people,
        detected_count=len(views.frame),
    )
