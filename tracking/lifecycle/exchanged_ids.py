"""Finds ids that tracks took from each other, by how people look once each is seen alone again.

While people overlap, their boxes and histograms are mixed, and a window is too short to see how it ends: a
track goes on with the one in front, and who reappears gets the wrong id, or a new one. Templates follow
within a second. So how everybody looked before is remembered for longer (`AppearanceMemory`), and compared.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from tracking.appearance import AppearanceMeasure, appearance_distance_matrix
from tracking.boxes import Floats, distance_in_heights, iou
from tracking.frame_rate import frames_in
from tracking.model.object_state import TrackedObject

_MAX_OVERLAP = 0.1
"""Overlap (IoU) above which two people meet, and their histograms are mixed."""
_HIDDEN_NEAR_S = 0.6
"""Seconds for which somebody hidden is taken to be where they were seen last."""
_COMPARED_S, _MIN_COMPARED = 0.6, 4
"""Seconds and least number of the latest sightings that are compared."""
_MAX_GAP_S, _MIN_GAP = 0.2, 2
"""Longest gap between two of these, in seconds, and what it is at least, in frames."""
_MEMORY_S = 6.0
"""Seconds of sightings that the appearance of an id is the mean of."""
_MET_S, _HIDDEN_S = 8.0, 5.0
"""Seconds since two met, or since somebody was seen last, for which they can be taken for each other."""
_REACH, _SPEED = 1.0, 1.5
"""Heights, and heights per second, by which somebody who was hidden can have moved."""
_MAX_DISTANCE, _UNKNOWN = 0.25, 0.35
"""Largest distance of the same person; distance of a track to its own id before that has an appearance."""
_LEARNING_LEAD = 0.04
"""Distance by which an id must resemble its track more than all others do, to learn from it."""
_NEVER = 9.0


@dataclass(frozen=True, slots=True, eq=False)
class _Candidates:
    """Tracks seen alone, and the ids that they can be.

    Attributes:
        tracks: their objects.
        all: these, and then hidden ones.
        distances: (T, C) from what a track sees to the appearance of each id; `_NEVER`: it cannot be that.
        min_gain: distance that each exchanged track must gain, as a mean.
    """

    tracks: Sequence[TrackedObject]
    all: Sequence[TrackedObject]
    distances: Floats
    min_gain: float

    def exchanges(self) -> dict[int, int]:
        """Return the new id of each track that has somebody else's; and of those whose ids they get."""
        costs = self.distances.copy()
        costs[np.arange(len(self.tracks)), np.arange(len(self.tracks))] -= self.min_gain
        rows, columns = linear_sum_assignment(costs)
        moved = {
            self.tracks[row].id: self.all[column].id
            for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
            if row != column and self.distances[row, column] < _NEVER
        }
        left = sorted(moved.keys() - set(moved.values()))
        for number in sorted(set(moved.values()) - moved.keys()):
            moved[number] = left.pop(0)
        return moved


class ExchangedIds:
    """Watches final frames, one after the other. What it knows is with the objects."""

    def __init__(self, fps: float, measure: AppearanceMeasure, min_gain: float) -> None:
        """Create a watch; `min_gain`: distance that each exchanged track must gain, as a mean."""
        self._min_gain = min_gain
        self._measure: AppearanceMeasure = measure
        self._compared = frames_in(_COMPARED_S, fps, _MIN_COMPARED)
        self._gap = frames_in(_MAX_GAP_S, fps, _MIN_GAP)
        self._memory = frames_in(_MEMORY_S, fps)
        self._near, self._met, self._hidden = (
            seconds * fps for seconds in (_HIDDEN_NEAR_S, _MET_S, _HIDDEN_S)
        )
        self._fps = fps

    def update(
        self,
        frame: int,
        objects: Sequence[TrackedObject],
        histograms: Mapping[int, Floats],
        fixed: Collection[int] = (),
    ) -> set[int]:
        """Add a final frame, and exchange the ids that were; return the ids that end: they were others'.

        Args:
            frame: its number.
            objects: all objects, after this frame; their ids change.
            histograms: by id, those of the detections of the objects seen in this frame.
            fixed: ids that are right, as an operator said.
        """
        self._note(frame, objects, histograms)
        tracks = [
            item for item in objects if item.id in histograms and len(item.memory.latest) >= self._compared
        ]
        if not tracks:
            return set()
        hidden = [
            item
            for item in objects
            if item.id not in histograms
            and _since(item, frame) <= self._hidden
            and item.memory.histogram is not None
        ]
        candidates = self._compare(frame, tracks, hidden, fixed)
        moved = candidates.exchanges()
        self._learn(candidates, moved)
        return _exchange(frame, objects, moved, set(histograms)) if moved else set()

    def _note(self, frame: int, objects: Sequence[TrackedObject], histograms: Mapping[int, Floats]) -> None:
        """Keep who is seen alone, and who meets whom."""
        for item in objects:
            memory = item.memory
            if item.id in histograms:
                if memory.last is None:
                    memory.first = frame
                elif frame - memory.last > self._gap:
                    memory.latest = []
                memory.last = frame
            memory.met = {other: met for other, met in memory.met.items() if frame - met <= self._met}
        near = [item for item in objects if _since(item, frame) <= self._near]
        boxes = np.array([item.box for item in near]).reshape(-1, 4)
        overlaps = iou(boxes[:, None], boxes[None]) > _MAX_OVERLAP
        np.fill_diagonal(overlaps, val=False)
        for item, row in zip(near, overlaps, strict=True):
            item.memory.met |= {near[other].id: frame for other in np.flatnonzero(row)}
            if row.any():
                item.memory.latest = []
            elif item.id in histograms:
                item.memory.latest = [*item.memory.latest, histograms[item.id]][-self._compared :]

    def _compare(
        self,
        frame: int,
        tracks: Sequence[TrackedObject],
        hidden: Sequence[TrackedObject],
        fixed: Collection[int],
    ) -> _Candidates:
        everybody = [*tracks, *hidden]
        sees = np.stack([np.mean(item.memory.latest, axis=0) for item in tracks])
        known = [c for c, item in enumerate(everybody) if item.memory.histogram is not None]
        distances = np.full((len(tracks), len(everybody)), _NEVER)
        if known:
            means = np.stack([np.asarray(everybody[c].memory.histogram) for c in known])
            distances[:, known] = appearance_distance_matrix(sees, means, self._measure)
        distances[distances > _MAX_DISTANCE] = _NEVER
        for t, item in enumerate(tracks):
            for c, other in enumerate(everybody):
                met = other.id in item.memory.met if c < len(tracks) else self._reaches(frame, other, item)
                if not met or not {item.id, other.id}.isdisjoint(fixed):
                    distances[t, c] = _NEVER
            mean = item.memory.histogram
            distances[t, t] = (
                _UNKNOWN
                if mean is None
                else appearance_distance_matrix(sees[[t]], mean[None], self._measure)[0, 0]
            )
        return _Candidates(tracks, everybody, distances, self._min_gain)

    def _reaches(self, frame: int, hidden: TrackedObject, track: TrackedObject) -> bool:
        """Return whether somebody hidden can be where a track is."""
        elapsed = _since(hidden, frame) / self._fps
        return bool(distance_in_heights(hidden.box, track.box[None])[0] <= _REACH + _SPEED * elapsed)

    def _learn(self, candidates: _Candidates, moved: Mapping[int, int]) -> None:
        for t, item in enumerate(candidates.tracks):
            own, memory = candidates.distances[t, t], item.memory
            others = np.delete(candidates.distances[t], t).min(initial=_NEVER)
            if item.id in moved:
                continue
            if memory.histogram is None:
                if others > _UNKNOWN:
                    memory.start(memory.latest)
            elif own < min(_MAX_DISTANCE, others - _LEARNING_LEAD):
                memory.learn(memory.latest[-1], self._memory)


def _since(item: TrackedObject, frame: int) -> float:
    """Return the number of frames since somebody was seen; infinite: not yet."""
    return np.inf if item.memory.last is None else frame - item.memory.last


def _exchange(
    frame: int, objects: Sequence[TrackedObject], moved: Mapping[int, int], seen: Collection[int]
) -> set[int]:
    """Exchange ids; somebody hidden whose id another gets is hidden where that was. Return the ids that end.

    An id ends that was given to somebody while they were hidden under another.
    """
    before = {item.id: item for item in objects}
    known = {number: before[number].memory.copy() for number in moved}
    sources = {new: old for old, new in moved.items()}
    ended = set[int]()
    for old, new in moved.items():
        item = before[old]
        item.id = new
        item.memory.take_id_of(known[new])
        item.memory.met = {}
        if old in seen:
            continue
        # The id that this hidden one gets was on the track that now has another's.
        track = before[new] if new in seen else before[sources[old]]
        first, last = known[new].first, known[old].last
        newborn = sources[old] == new and first is not None and last is not None and first > last
        if newborn or item.memory.histogram is None:
            ended.add(new)
            continue
        item.restart_at(track.box, frame - 1)
        item.memory.last, item.memory.latest = frame - 1, []
        item.histogram = item.memory.histogram
        item.present = False
    return ended
