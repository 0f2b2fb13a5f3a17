"""Late corrections: the frame of an identity switch, and the corrections it implies since then."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats, distance_in_heights, heights
from tracking.interactive.corrections import PositionCorrection, normalized_squared_distance
from tracking.interactive.swap_margins import find_cheapest_swaps
from tracking.interactive.window_memory import WindowMemory
from tracking.model.network import build_network
from tracking.model.object_state import Template
from tracking.model.settings import CostSettings
from tracking.solvers.base import OCCLUDED
from tracking.types import Detections

_MAX_OFFSET = 0.5
"""Largest `normalized_squared_distance` of the track that the operator pointed at."""


def backdate_correction(
    correction: PositionCorrection, memory: WindowMemory, costs: CostSettings, since: int
) -> list[PositionCorrection]:
    """Return the corrections for earlier frames that a correction implies, back to the frame `since`.

    The operator pointed at object a where the tracker had object b, while a was elsewhere or occluded: a and
    b swapped identities earlier. The swap is dated to the frame from which exchanging the two tracks costs
    least (`find_cheapest_swaps` in a network of the two and their boxes, without motion), or to the start of
    b if a was occluded then. From that frame on, a is corrected to b's boxes and b to a's.

    Returns an empty list if a is already at the point, if no other track is there, or if a may be occluded by
    b.
    """
    a, b = correction.object, _track_at_point(correction, memory)
    if b is None:
        return []
    frames = [n for n in sorted(memory.assignments) if since <= n <= correction.frame]
    states = np.array([[memory.assignments[n].get(k, OCCLUDED) for n in frames] for k in (a, b)])
    if _is_occluded_by_other(states != OCCLUDED):
        return []
    start = _first_swapped(states, [memory.detections.get(n) for n in frames], costs)
    return [
        PositionCorrection(n, corrected, *_exact_point(memory.detections[n].boxes[state]))
        for index, n in enumerate(frames)
        if start <= index < len(frames) - 1
        for corrected, state in ((a, states[1, index]), (b, states[0, index]))
        if state != OCCLUDED
    ]


def _track_at_point(correction: PositionCorrection, memory: WindowMemory) -> int | None:
    """Return the track at the corrected point, if it is not the corrected track."""
    assigned = memory.assignments.get(correction.frame, {})
    far = {
        number: float(
            normalized_squared_distance(correction, memory.detections[correction.frame].boxes[state])
        )
        for number, state in assigned.items()
    }
    if not far:
        return None
    nearest = min(far, key=lambda number: (far[number], number != correction.object, number))
    return nearest if nearest != correction.object and far[nearest] < _MAX_OFFSET else None


def _is_occluded_by_other(visible: NDArray[np.bool_]) -> bool:
    """Return whether b may occlude a: the visibility `(2, M)` of a ends, and b was visible before."""
    shown = np.flatnonzero(visible[0])
    return bool(len(shown) and not visible[0, -1] and visible[1, : shown[-1] + 1].any())


def _exact_point(box: Floats) -> tuple[float, float, float]:
    """Return the center of a box, and the tolerance of an exact correction."""
    x, y = (box[:2] + box[2:]) / 2.0
    return float(x), float(y), max(float(heights(box)) / 4.0, 1.0)


def _first_swapped(
    states: NDArray[np.int64], frames: Sequence[Detections | None], costs: CostSettings
) -> int:
    """Return the index of the first frame after two tracks, states `(2, M)`, have swapped."""
    visible = states != OCCLUDED
    began = int(visible[1].argmax())
    if began > 0 and not visible[0, began:].any():
        return began
    rows = [np.unique(column[column != OCCLUDED]) for column in states.T]
    bins = next(detections.histograms.shape[1] for detections in frames if detections is not None)
    selected = [_select_rows(detections, row, bins) for detections, row in zip(frames, rows, strict=True)]
    local = np.array(
        [
            [OCCLUDED if k == OCCLUDED else int(np.searchsorted(row, k)) for k in pair]
            for pair, row in zip(states.T, rows, strict=True)
        ]
    ).T
    if visible.any(axis=1).all():
        templates = [_template(n, row, selected) for n, row in enumerate(local)]
        found = find_cheapest_swaps(build_network(templates, selected, costs), local)
        if np.isfinite(found.margins[0, 1]):
            return int(found.frames[0, 1])
    return _nearest(local, selected)


def _template(number: int, states: NDArray[np.int64], frames: Sequence[Detections]) -> Template:
    """Return the template of an object at its first observation; its box only if that is in frame 0."""
    m = int((states != OCCLUDED).argmax())
    found = frames[m]
    return Template(number, found.histograms[states[m]], found.boxes[states[m]] if m == 0 else None)


def _select_rows(detections: Detections | None, rows: NDArray[np.int64], bins: int) -> Detections:
    if detections is None or not len(rows):
        return Detections.empty(bins)
    return Detections(detections.boxes[rows], detections.scores[rows], detections.histograms[rows])


def _nearest(states: NDArray[np.int64], frames: Sequence[Detections]) -> int:
    """Return the index of the last frame in which two visible tracks were nearest, or b's first frame."""
    both = np.flatnonzero((states != OCCLUDED).all(axis=0))
    if not len(both):
        return int(np.flatnonzero(states[1] != OCCLUDED)[0]) if (states[1] != OCCLUDED).any() else 0
    distances = [float(distance_in_heights(*frames[m].boxes[states[:, m]])) for m in both.tolist()]
    return int(both[len(distances) - 1 - int(np.argmin(distances[::-1]))])
