"""Which tracks of a camera turn out to have taken each other's person over, where its past was mended."""

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
"""Overlap (IoU) from which two boxes are one: what is mended are the same detections in other hands."""
_MIN_FRAMES = 2
"""Frames in which each must be in the other's place at least."""


class IdSwitch(NamedTuple):
    """Two tracks, and the first frame in which each follows the other's person."""

    one: TrackKey
    two: TrackKey
    frame: int


def find_id_switches(mended: CameraWindow, before: Sequence[HistorySpan[CameraWindow]]) -> list[IdSwitch]:
    """Compare the tracks of some frames with what was published of them before.

    Two tracks have exchanged their people where from some frame on each is now where the other one was, and
    neither where it was itself. That three exchange theirs in a ring is not told.

    Args:
        mended: the window that is new.
        before: what was said of its frames that were final, in order; the first of them may be forgotten.
    """
    if not before:
        return []
    # What is forgotten before them was exchanged, too, or they would not be from the first of them on.
    first, last = max(mended.first, before[0].first), before[-1].last
    new = mended.boxes[:, first - mended.first : last - mended.first + 1]
    old = _published_boxes(mended.keys, before, first, last)
    same = _overlap(new[:, None], old[None]) > _SAME_IOU  # (T, T, F): track now, track before
    found = []
    for one, two in combinations(range(len(mended.keys)), 2):
        kept = np.flatnonzero(same[one, one] | same[two, two])
        since = int(kept[-1]) + 1 if kept.size else 0
        count = int(min(same[one, two, since:].sum(), same[two, one, since:].sum()))
        if count >= _MIN_FRAMES:
            frame = first + since if kept.size else mended.first
            found.append((-count, IdSwitch(mended.keys[one], mended.keys[two], frame)))
    # In a crowd a box is in more than one other's place: the clearest pairs, and nobody in two of them.
    taken: set[TrackKey] = set()
    exchanges = []
    for _, it in sorted(found):
        if taken.isdisjoint((it.one, it.two)):
            taken |= {it.one, it.two}
            exchanges.append(it)
    return exchanges


def _published_boxes(
    keys: Sequence[TrackKey], said: Sequence[HistorySpan[CameraWindow]], first: int, last: int
) -> Floats:
    """Return where tracks were said to be in the frames from `first` to `last`: (T, F, 4), NaN: nowhere."""
    boxes = np.full((len(keys), last - first + 1, 4), np.nan)
    row = {key: n for n, key in enumerate(keys)}
    for it in said:
        theirs = slice(it.first - it.window.first, it.last - it.window.first + 1)
        for key, path in zip(it.window.keys, it.window.boxes, strict=True):
            if key in row:
                boxes[row[key], it.first - first : it.last - first + 1] = path[theirs]
    return boxes


def _overlap(one: Floats, two: Floats) -> Floats:
    """Return the overlap (IoU) of boxes (..., 4); 0 where one of them is nowhere."""
    wide = np.minimum(one[..., 2], two[..., 2]) - np.maximum(one[..., 0], two[..., 0])
    high = np.minimum(one[..., 3], two[..., 3]) - np.maximum(one[..., 1], two[..., 1])
    both = np.maximum(wide, 0.0) * np.maximum(high, 0.0)
    areas = [(it[..., 2] - it[..., 0]) * (it[..., 3] - it[..., 1]) for it in (one, two)]
    either = areas[0] + areas[1] - both
    return np.asarray(np.divide(both, either, out=np.zeros(both.shape), where=(both > 0) & (either > 0)))
