"""Finds identity switches between two tracks of a camera by comparing a revised window with its past."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bestview import TrackKey
from server.service.identity.camera_window import CameraWindow
from server.service.ingest.window_history import HistorySpan

Floats = NDArray[np.float64]

_SAME_IOU = 0.5
"""IoU from which two boxes are the same: a revision assigns the same detections to other tracks."""
_MIN_FRAMES = 2
"""Frames in which each must be in the other's place, at least."""


class IdSwitch(NamedTuple):
    """Two tracks, and the first frame in which each follows the other's person."""

    one: TrackKey
    two: TrackKey
    frame: int


def find_id_switches(revised: CameraWindow, before: Sequence[HistorySpan[CameraWindow]]) -> list[IdSwitch]:
    """Compare the tracks of some frames with what was published of them before.

    Two tracks have switched where from some frame on each has the other's former boxes and neither its own.
    A cyclic switch of three tracks is not detected.

    Args:
        revised: the new window.
        before: the earlier windows of its final frames, in order; the first frames may be missing.
    """
    if not before:
        return []
    # A switch from the first known frame on began in a frame that is no longer known.
    first, last = max(revised.first, before[0].first), before[-1].last
    new = revised.boxes[:, first - revised.first : last - revised.first + 1]
    old = _published_boxes(revised.keys, before, first, last)
    same = _overlap(new[:, None], old[None]) > _SAME_IOU  # (T, T, F): track now, track before
    switches = []
    for one, two in combinations(range(len(revised.keys)), 2):
        unchanged = np.flatnonzero(same[one, one] | same[two, two])
        since = int(unchanged[-1]) + 1 if unchanged.size else 0
        count = int(min(same[one, two, since:].sum(), same[two, one, since:].sum()))
        if count >= _MIN_FRAMES:
            frame = first + since if unchanged.size else revised.first
            switches.append((-count, IdSwitch(revised.keys[one], revised.keys[two], frame)))
    # In a crowd a box overlaps several others: take the longest matches first, each track once.
    used: set[TrackKey] = set()
    selected = []
    for _, it in sorted(switches):
        if used.isdisjoint((it.one, it.two)):
            used |= {it.one, it.two}
            selected.append(it)
    return selected


def _published_boxes(
    keys: Sequence[TrackKey], published: Sequence[HistorySpan[CameraWindow]], first: int, last: int
) -> Floats:
    """Return the tracks' published boxes in the frames from `first` to `last`: (T, F, 4), NaN: hidden."""
    boxes = np.full((len(keys), last - first + 1, 4), np.nan)
    row = {key: n for n, key in enumerate(keys)}
    for it in published:
        rows = slice(it.first - it.window.first, it.last - it.window.first + 1)
        for key, path in zip(it.window.keys, it.window.boxes, strict=True):
            if key in row:
                boxes[row[key], it.first - first : it.last - first + 1] = path[rows]
    return boxes


def _overlap(one: Floats, two: Floats) -> Floats:
    """Return the IoU of boxes (..., 4); 0 where either is hidden (NaN)."""
    wide = np.minimum(one[..., 2], two[..., 2]) - np.maximum(one[..., 0], two[..., 0])
    high = np.minimum(one[..., 3], two[..., 3]) - np.maximum(one[..., 1], two[..., 1])
    both = np.maximum(wide, 0.0) * np.maximum(high, 0.0)
    areas = [(it[..., 2] - it[..., 0]) * (it[..., 3] - it[..., 1]) for it in (one, two)]
    either = areas[0] + areas[1] - both
    return np.asarray(np.divide(both, either, out=np.zeros(both.shape), where=(both > 0) & (either > 0)))
