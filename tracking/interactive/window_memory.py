"""Memory of past windows: detections, assignments, and the tracker's state before each window."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import BOX_SIDES, Floats, iou
from tracking.interactive.corrections import PositionCorrection, normalized_squared_distance
from tracking.interactive.hypothesis_insertion import box_around, has_hypothesis, insert_hypothesis
from tracking.interactive.settings import InteractiveSettings, ResolvedInteractiveSettings
from tracking.model.object_state import TrackedObject
from tracking.solvers.base import OCCLUDED
from tracking.solvers.warm_start import WindowWarmStart
from tracking.types import Detections

_MIN_SAME_IOU = 0.5
"""Overlap (IoU) from which a new track is the one that started there before its window was undone."""


@dataclass(frozen=True, slots=True, eq=False)
class WindowSnapshot:
    """The tracker's state before a window is solved.

    Attributes:
        first: its first frame.
        end: its last frame.
        final_to: the last frame that becomes final.
        objects: the object list before it.
        warm_start: the warm start from the previous window.
    """

    first: int
    end: int
    final_to: int
    objects: tuple[TrackedObject, ...]
    warm_start: WindowWarmStart | None

    @property
    def solve_order(self) -> tuple[int, int]:
        """Sort key: windows are solved in this order."""
        return self.end, self.final_to


@dataclass(frozen=True, slots=True, eq=False)
class InitiatedTrack:
    """A new track: start frame, box, id, and the window it started in."""

    frame: int
    box: Floats
    id: int
    window: tuple[int, int]


class WindowMemory:
    """The data to re-solve the windows of the last `memory_frames` frames of the settings.

    Attributes:
        detections: the detections by frame; missing frames had none.
        assignments: by frame, the index of each track's observation.
        inserted: by frame, the index of the observation inserted for each corrected object.
        snapshots: the windows, oldest first.
    """

    def __init__(self, settings: ResolvedInteractiveSettings) -> None:
        self._settings = settings
        self._initiated: list[InitiatedTrack] = []
        self._undone: list[InitiatedTrack] = []
        """Tracks of undone windows: a track that starts there again gets the same id."""
        self.detections: dict[int, Detections] = {}
        self.assignments: dict[int, Mapping[int, int]] = {}
        self.inserted: dict[int, dict[int, int]] = {}
        self.snapshots: deque[WindowSnapshot] = deque()

    def add_detections(self, frame: int, detections: Detections) -> None:
        """Add the detections of a frame, and drop frames older than the memory."""
        self.detections[frame] = detections
        oldest = frame - self._settings.memory_frames
        # A window that begins before the memory needs its detections, too.
        while self.snapshots and self.snapshots[0].end < oldest:
            self.snapshots.popleft()
        oldest = min(oldest, self.snapshots[0].first if self.snapshots else frame)
        self.detections = {n: found for n, found in self.detections.items() if n >= oldest}
        self.assignments = {n: assigned for n, assigned in self.assignments.items() if n >= oldest}
        self.inserted = {n: indices for n, indices in self.inserted.items() if n >= oldest}
        oldest -= self._settings.start_shift
        self._initiated = [track for track in self._initiated if track.frame >= oldest]
        self._undone = [track for track in self._undone if track.frame >= oldest]

    def ensure_hypothesis(self, correction: PositionCorrection, histogram: Floats) -> None:
        """Ensure that a corrected object has a fitting observation: insert a hypothesis, or move it."""
        frame, number = correction.frame, correction.object
        size, detections = self._size(number, frame), self.detections.get(frame)
        if size is None or detections is None:
            return
        inserted = self.inserted.get(frame, {})
        detected = len(detections) - len(inserted)
        box = box_around(correction, size)
        if number in inserted:
            boxes = detections.boxes.copy()
            boxes[inserted[number]] = box
            self.detections[frame] = Detections(boxes, detections.scores, detections.histograms)
        elif not has_hypothesis(correction, size, detections.boxes[:detected]):
            self.detections[frame] = insert_hypothesis(detections, box, histogram)
            self.inserted[frame] = {**inserted, number: len(detections)}

    def _size(self, number: int, frame: int) -> Floats | None:
        """Return the median size of an object around a frame, `(2,)` pixels (width, height)."""
        around = self._settings.size_frames
        sides = [
            self.detections[n].boxes[self.assignments[n][number]]
            for n in range(frame - around, frame + around + 1)
            if number in self.assignments.get(n, {})
            and number not in self.inserted.get(n, {})
            and n in self.detections
        ]
        return np.median([box[2:] - box[:2] for box in sides], axis=0) if sides else None

    def record_window(self, snapshot: WindowSnapshot) -> None:
        """Record a window about to be solved; later windows become invalid."""
        while self.snapshots and self.snapshots[-1].solve_order >= snapshot.solve_order:
            self.snapshots.pop()
        self.snapshots.append(snapshot)
        self._undone += [track for track in self._initiated if track.window >= snapshot.solve_order]
        self._initiated = [track for track in self._initiated if track.window < snapshot.solve_order]

    def record_states(self, first: int, ids: Sequence[int], states: npt.NDArray[np.int64]) -> None:
        """Record a window's solution `(n, M)` from the frame `first` on, -1 where occluded."""
        for m, column in enumerate(states.T.tolist()):
            self.assignments[first + m] = {
                number: state for number, state in zip(ids, column, strict=True) if state != OCCLUDED
            }

    def keep_only(self, first: int, ids: set[int]) -> None:
        """Drop the assignments of ended tracks (not in `ids`) from the frame `first` on."""
        for frame in [n for n in self.assignments if n >= first]:
            self.assignments[frame] = {
                number: state for number, state in self.assignments[frame].items() if number in ids
            }

    def boxes_of(self, ids: Sequence[int], last: int, frames: int) -> Floats:
        """Return objects' boxes in the `frames` frames up to `last`, `(n, frames, 4)`, NaN where occluded."""
        boxes = np.full((len(ids), frames, BOX_SIDES), np.nan)
        for index, frame in enumerate(range(last - frames + 1, last + 1)):
            assigned = self.assignments.get(frame, {})
            for n, number in enumerate(ids):
                if number in assigned:
                    boxes[n, index] = self.detections[frame].boxes[assigned[number]]
        return boxes

    def windows_since(self, frame: int) -> Sequence[WindowSnapshot]:
        """Return the windows from the first that contains this frame on; empty if it is not in memory."""
        if not self.snapshots or frame < self.snapshots[0].first:
            return ()
        return [window for window in self.snapshots if window.end >= frame]

    def disagreement_cost(self, correction: PositionCorrection, settings: InteractiveSettings) -> float:
        """Return the cost by which a correction contradicts the solution; 0 if they agree."""
        if correction.frame not in self.assignments or correction.frame not in self.detections:
            return 0.0
        far = normalized_squared_distance(correction, self.detections[correction.frame].boxes)
        state = self.assignments[correction.frame].get(correction.object)
        current = settings.hidden_share if state is None else float(far[state])
        return settings.correction_weight * (
            current - min(float(far.min(initial=1.0)), settings.hidden_share)
        )

    def assign_id(self, frame: int, box: Floats, new_id: int) -> int:
        """Return the id of a new track: `new_id`, or its id before its window was undone.

        Otherwise ids are never reused.
        """
        known = self._undone_track(frame, box)
        if known is not None:
            self._undone.remove(known)
        number = new_id if known is None else known.id
        self._initiated.append(InitiatedTrack(frame, box, number, self.snapshots[-1].solve_order))
        return number

    def _undone_track(self, frame: int, box: Floats) -> InitiatedTrack | None:
        """Return the track that started there in an undone window."""
        near = [track for track in self._undone if abs(track.frame - frame) <= self._settings.start_shift]
        found = max(near, key=lambda it: (float(iou(it.box, box)), -it.id), default=None)
        return found if found is not None and float(iou(found.box, box)) >= _MIN_SAME_IOU else None
