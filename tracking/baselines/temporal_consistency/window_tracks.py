"""What is told of a window's frames: everybody's boxes, and how they look by the detections there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tracking.appearance_samples import add_appearance_samples
from tracking.baselines.temporal_consistency.trajectories import Stops, Trails
from tracking.boxes import Floats, iou
from tracking.model.object_state import mean_histogram
from tracking.solvers.base import OCCLUDED
from tracking.types import Detections
from tracking.window import WindowTrack

_SAME = 0.3
"""Overlap (IoU) from which a detection shows whoever a blob is."""


def told_tracks(
    stops: Stops, trails: Trails, seen: Sequence[Detections], first: int, final: int
) -> tuple[WindowTrack, ...]:
    """Give the tracks of the frames from `first` on, of which `seen` are the detections, by ascending number.

    `final` is the last of them that never changes again.
    """
    tracks, states = [], []
    for number, mine in sorted(stops.items()):
        boxes = trails.along(mine, first, first + len(seen) - 1)
        if np.isnan(boxes).all():
            continue
        shown = _shown(boxes, seen)
        looks = [it.histograms[at] for it, at in zip(seen, shown, strict=True) if at != OCCLUDED]
        histogram = mean_histogram(np.stack(looks)) if looks else np.empty(seen[0].histograms.shape[1])
        sure = float(np.mean(~np.isnan(boxes[:, 0])))
        tracks.append(WindowTrack(number, boxes, boxes, histogram, sure))
        states.append(shown)
    return add_appearance_samples(tracks, states, first, seen[: final - first + 1])


def _shown(boxes: Floats, seen: Sequence[Detections]) -> NDArray[np.int64]:
    """Say which detection shows somebody in each frame, `(F,)`, -1 for none."""
    states = np.full(len(seen), OCCLUDED, dtype=np.int64)
    for row, found in enumerate(seen):
        if len(found) and not np.isnan(boxes[row, 0]):
            overlaps = iou(boxes[row][None], found.boxes)
            best = int(overlaps.argmax())
            states[row] = best if overlaps[best] >= _SAME else OCCLUDED
    return states
