"""Views of people that a camera does not detect: missed for a while, or inferred from other cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.view_selection.sparse_costs import VisibleViews

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class LastDetections:
    """Last detection of each person by each camera before frame 0, C cameras and K people.

    Attributes:
        age: (C, K) frames before frame 0, at least 1; infinite: never.
        quality: (C, K) of that view.
    """

    age: Floats
    quality: Floats

    def advanced_to(self, views: VisibleViews, frames: int) -> LastDetections:
        """Return the last detections before frame `frames`, given the views until then."""
        age, quality = self.age + frames, self.quality.copy()
        rows = np.flatnonzero(views.frame < frames)
        cells = views.camera[rows], views.person[rows]
        # Rows of later frames come later, and the last assignment to a cell stays.
        age[cells], quality[cells] = frames - views.frame[rows], views.quality[rows]
        return LastDetections(age, quality)


def add_missed_detections(views: VisibleViews, last: LastDetections, decay_frames: float) -> VisibleViews:
    """Keep views of people who are not detected any more, with decaying quality.

    *n* frames after the last detection a view has ``1 - n / decay_frames`` of its quality, until the camera
    detects the person again. Detectors miss people for short times, which should not cause cuts.

    Args:
        views: detected ones.
        last: the last detections before.
        decay_frames: 0 or more.

    Returns:
        The detected views, and then the missed ones, each rising by frame for a camera and person.
    """
    (frames, cameras), people = views.available.shape, views.person_count
    if not frames or decay_frames <= 1.0:
        return views
    key = views.camera * people + views.person
    detected = np.zeros((frames, cameras * people), dtype=np.bool_)
    detected[views.frame, key] = True
    at_start = np.flatnonzero((last.age.reshape(-1) < decay_frames) & ~detected[0])
    ends, missed_keys = np.divmod(np.flatnonzero(detected[:-1] & ~detected[1:]), cameras * people)
    row = np.empty(detected.shape, dtype=np.int32)
    row[views.frame, key] = np.arange(len(key), dtype=np.int32)
    cells = np.concatenate([at_start, missed_keys])
    last_seen = np.concatenate([-last.age.reshape(-1)[at_start], ends])
    last_quality = np.concatenate([last.quality.reshape(-1)[at_start], views.quality[row[ends, missed_keys]]])
    begin = np.concatenate([np.zeros(len(at_start), dtype=np.int64), ends + 1])
    redetected = detected[:, cells] & (np.arange(frames)[:, None] >= begin)
    until = np.where(redetected.any(axis=0), redetected.argmax(axis=0), frames)
    until = np.minimum(until, np.ceil(last_seen + decay_frames).astype(np.int64))
    count = np.maximum(until - begin, 0)
    owner = np.repeat(np.arange(len(cells)), count)
    frame = np.arange(len(owner)) + np.repeat(begin - (np.cumsum(count) - count), count)
    remaining = last_quality[owner] * (1.0 - (frame - last_seen[owner]) / decay_frames)
    camera, person = np.divmod(cells[owner], people)
    counts = (remaining > 0.0) & views.available[frame, camera]
    return VisibleViews(
        np.concatenate([views.frame, frame[counts]]),
        np.concatenate([views.camera, camera[counts]]),
        np.concatenate([views.person, person[counts]]),
        np.concatenate([views.quality, remaining[counts]]),
        views.available,
        people,
        detected_count=len(views.frame),
    )


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
