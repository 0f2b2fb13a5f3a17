"""The boxes of a camera's frames, labeled with person numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestview import TrackKey
from server.messaging.messages import NumberedBox
from server.service.identity.camera_window import CameraWindow
from server.service.ingest.window_history import HistorySpan

Numbers = Callable[[Sequence[TrackKey], int, int], NDArray[np.int64]]
"""Maps T tracks to person numbers: tracks, first frame, frames -> (T, frames)."""


def numbered_boxes(
    spans: Sequence[HistorySpan[CameraWindow]], numbers: Numbers, first: int, frames: int
) -> list[list[NumberedBox]]:
    """Return the boxes of each of the frames from `first` on, by rising number.

    Of two tracks of one person in one frame the first counts. Unconfirmed tracks, whose numbers are negative,
    are left out.
    """
    boxes_per_frame: list[list[NumberedBox]] = [[] for _ in range(frames)]
    for span in spans:
        window, count = span.window, span.last - span.first + 1
        place = span.first - window.first
        boxes = window.boxes[:, place : place + count]
        person = numbers(window.keys, span.first, count)
        # Frame by frame, and in a frame in the tracks' order.
        frame, track = np.nonzero((~np.isnan(boxes[..., 0]) & (person >= 0)).T)
        number = person[track, frame]
        order = np.lexsort((number, frame))
        frame, track, number = frame[order], track[order], number[order]
        new = np.ones(len(order), dtype=np.bool_)
        new[1:] = (frame[1:] != frame[:-1]) | (number[1:] != number[:-1])
        frame, track, number = frame[new], track[new], number[new]
        rows = list(zip(number.tolist(), *boxes[track, frame].T.tolist(), strict=True))
        ends = np.searchsorted(frame, np.arange(count + 1)).tolist()
        for at, (begin, end) in enumerate(pairwise(ends), start=span.first - first):
            boxes_per_frame[at] = rows[begin:end]
    return boxes_per_frame
