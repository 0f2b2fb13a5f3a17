"""Late corrections: where an identity was lost, and what follows for the frames since."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats, heights, normalized_distance
from tracking.interactive.corrections import PositionCorrection, normalized_offset
from tracking.interactive.swap_margins import swap_margins
from tracking.interactive.window_memory import WindowMemory
from tracking.model.network import build_network
from tracking.model.object_state import Template
from tracking.model.settings import CostSettings
from tracking.solvers.base import OCCLUDED
from tracking.types import Detections

_MAX_OFFSET = 0.5
"""How far (`normalized_offset`) a track may be from the point to be the one that is pointed at."""


def backdate_correction(
    correction: PositionCorrection, memory: WindowMemory, costs: CostSettings, since: int
) -> list[PositionCorrection]:
    """Return the corrections for earlier frames that a correction implies, back to the frame `since`.

    The operator pointed at object a where the tracker had object b, while a was elsewhere or hidden: a and
    b swapped identities earlier. The swap is placed at the frame from which exchanging the two tracks costs
    least (`swap_margins` in a network of the two and their own boxes, without motion). If b began while a
    was hidden, it is placed where b began. From that frame on, a is corrected to b's boxes and b to a's.

    Returns an empty list where a is already at the point, where no other track is, or where a may be
    occluded by b.
    """
    a, b = correction.object, _track_at_point(correction, memory)
    if b is None:
        return []
    frames = [n for n in sorted(memory.assignments) if since <= n <= correction.frame]
    states = np.array([[memory.assignments[n].get(k, OCCLUDED) for n in frames] for k in (a, b)])
    if _covered(states != OCCLUDED):
        return []
    start = _start(states, [memory.detections.get(n) for n in frames], costs)
    return [
        PositionCorrection(n, ours, *_exact_point(memory.detections[n].boxes[state]))
        for place, n in enumerate(frames)
        if start <= place < len(frames) - 1
        for ours, state in ((a, states[1, place]), (b, states[0, place]))
        if state != OCCLUDED
    ]


def _track_at_point(correction: PositionCorrection, memory: WindowMemory) -> int | None:
    """Return the track at the corrected point, if it is another one than the corrected track."""
    there = memory.assignments.get(correction.frame, {})
    far = {
        number: float(normalized_offset(correction, memory.detections[correction.frame].boxes[state]))
        for number, state in there.items()
    }
    if not far:
        return None
    nearest = min(far, key=lambda number: (far[number], number != correction.object, number))
    return nearest if nearest != correction.object and far[nearest] < _MAX_OFFSET else None


def _covered(seen: NDArray[np.bool_]) -> bool:
    """Return whether a may be occluded by b: a, the first row of `(2, M)`, ends hidden, and b was there."""
    shown = np.flatnonzero(seen[0])
    return bool(len(shown) and not seen[0, -1] and seen[1, : shown[-1] + 1].any())


def _exact_point(box: Floats) -> tuple[float, float, float]:
    """Return the center of a box, and the tolerance of an exact correction."""
    x, y = (box[:2] + box[2:]) / 2.0
    return float(x), float(y), max(float(heights(box)) / 4.0, 1.0)


def _start(states: NDArray[np.int64], frames: Sequence[Detections | None], costs: CostSettings) -> int:
    """Return the index of the first frame after two tracks, states `(2, M)`, have swapped."""
    seen = states != OCCLUDED
    began = int(seen[1].argmax())
    if began > 0 and not seen[0, began:].any():
        return began
    rows = [np.unique(column[column != OCCLUDED]) for column in states.T]
    bins = next(it.histograms.shape[1] for it in frames if it is not None)
    few = [_select_rows(it, row, bins) for it, row in zip(frames, rows, strict=True)]
    local = np.array(
        [
            [OCCLUDED if k == OCCLUDED else int(np.searchsorted(row, k)) for k in pair]
            for pair, row in zip(states.T, rows, strict=True)
        ]
    ).T
    if seen.any(axis=1).all():
        templates = [_template(n, row, few) for n, row in enumerate(local)]
        found = swap_margins(build_network(templates, few, costs), local)
        if np.isfinite(found.margins[0, 1]):
            return int(found.frames[0, 1])
    return _nearest(local, few)


def _template(number: int, states: NDArray[np.int64], frames: Sequence[Detections]) -> Template:
    """Return the template of an object as first seen; a box only if that is the first frame."""
    m = int((states != OCCLUDED).argmax())
    found = frames[m]
    return Template(number, found.histograms[states[m]], found.boxes[states[m]] if m == 0 else None)


def _select_rows(seen: Detections | None, rows: NDArray[np.int64], bins: int) -> Detections:
    if seen is None or not len(rows):
        return Detections.empty(bins)
    return Detections(seen.boxes[rows], seen.scores[rows], seen.histograms[rows])


def _nearest(states: NDArray[np.int64], frames: Sequence[Detections]) -> int:
    """Return the index of the frame in which two visible tracks were nearest, else b's first frame."""
    both = np.flatnonzero((states != OCCLUDED).all(axis=0))
    if not len(both):
        return int(np.flatnonzero(states[1] != OCCLUDED)[0]) if (states[1] != OCCLUDED).any() else 0
    apart = [float(normalized_distance(*frames[m].boxes[states[:, m]])) for m in both.tolist()]
    return int(both[len(apart) - 1 - int(np.argmin(apart[::-1]))])
