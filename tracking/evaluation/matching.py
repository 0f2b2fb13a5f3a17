"""The matching that MOTA and identity switches are counted by (CLEAR MOT).

In each frame as many pairs as possible stay as they were in the frame before; beyond that, the
overlap is largest. "The frame before" is to be taken literally: who was lost in between is matched
anew, as the official evaluation of MOTChallenge has it (which passes over frames without truth or
without tracks). Libraries that remember a pair over a gap count fewer switches (see py-motmetrics,
issue 132), so the pairs are settled here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from tracking.assignment import assign_pairs
from tracking.evaluation.frames import Frame

_STAY = 1000.0
"""Worth more than all overlaps of a frame together."""


def matched(frames: Iterable[Frame], least_iou: float) -> Iterator[NDArray[np.bool_]]:
    """Give for each frame which person is matched with which track, `(T, R)`."""
    before: dict[int, int] = {}
    for frame in frames:
        pairs = np.zeros(frame.similarity.shape, dtype=bool)
        if pairs.size:
            # NaN is no track's id.
            held = np.array([before.get(person, np.nan) for person in frame.truth.tolist()])
            stay = _STAY * (held[:, None] == frame.tracks[None])
            rows, columns = assign_pairs(frame.similarity, least_iou, stay)
            pairs[rows, columns] = True
            before = dict(zip(frame.truth[rows].tolist(), frame.tracks[columns].tolist(), strict=True))
        yield pairs
