"""The past seconds of a tracker: what was seen in them, and where it stood before each of its windows."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import BOX_SIDES, Floats, iou
from tracking.interactive.corrections import PositionCorrection, normalized_offset
from tracking.interactive.hypothesis_insertion import box_around, has_hypothesis, insert_hypothesis
from tracking.interactive.settings import InteractiveSettings
from tracking.model.object_state import TrackedObject
from tracking.solvers.base import OCCLUDED
from tracking.solvers.warm_start import WindowWarmStart
from tracking.types import Detections

_SAME_PLACE = 0.5
"""Overlap (IoU) from which somebody new is the one who began in that frame before."""

_AROUND = 50
"""Frames before and after in which it is looked how large somebody is."""

_SAME_TIME = 5
"""Frames by which somebody new may begin earlier or later than before."""


@dataclass(frozen=True, slots=True, eq=False)
class WindowSnapshot:
    """A window about to be solved.

    Attributes:
        first: its first frame.
        end: its last frame.
        final_to: the last frame that becomes final.
        objects: the object list before it.
        warm_start: what the window before it has told.
    """

    first: int
    end: int
    final_to: int
    objects: tuple[TrackedObject, ...]
    warm_start: WindowWarmStart | None

    @property
    def order(self) -> tuple[int, int]:
        """Which window it is: they come in this order."""
        return self.end, self.final_to


@dataclass(frozen=True, slots=True, eq=False)
class InitiatedTrack:
    """Somebody new: where and when, the number that they were given, and the window that it was in."""

    frame: int
    box: Floats
    id: int
    window: tuple[int, int]


class WindowMemory:
    """What a tracker needs to go back by up to `frames` frames. Bounded by them.

    Attributes:
        detections: the detections, by frame; a frame that is not there showed nothing.
        assignments: who was in which of them in the end, by frame: the observation's index by id.
        inserted: what was made of pointings, by frame: the observation's index by whom it was made for.
        snapshots: the windows, oldest first.
    """

    def __init__(self, frames: int) -> None:
        self._frames = frames
        self._births: list[InitiatedTrack] = []
        self._undone: list[InitiatedTrack] = []
        """Those whose windows are solved again: who begins there once more has their number."""
        self.detections: dict[int, Detections] = {}
        self.assignments: dict[int, Mapping[int, int]] = {}
        self.inserted: dict[int, dict[int, int]] = {}
        self.snapshots: deque[WindowSnapshot] = deque()

    def add_detections(self, frame: int, detections: Detections) -> None:
        """Take the detections of a frame, and forget what is too long ago."""
        self.detections[frame] = detections
        oldest = frame - self._frames
        # Of a window that reaches back beyond the memory, the detections are needed, too.
        while self.snapshots and self.snapshots[0].end < oldest:
            self.snapshots.popleft()
        oldest = min(oldest, self.snapshots[0].first if self.snapshots else frame)
        self.detections = {number: it for number, it in self.detections.items() if number >= oldest}
        self.assignments = {number: it for number, it in self.assignments.items() if number >= oldest}
        self.inserted = {number: it for number, it in self.inserted.items() if number >= oldest}
        self._births = [it for it in self._births if it.frame >= oldest - _SAME_TIME]
        self._undone = [it for it in self._undone if it.frame >= oldest - _SAME_TIME]

    def insert_hypothesis(self, pointing: PositionCorrection, look: Floats) -> None:
        """Make a place for who is pointed at, where nothing like them is found, or move what was made."""
        frame, who = pointing.frame, pointing.object
        size, seen = self._size(who, frame), self.detections.get(frame)
        if size is None or seen is None:
            return
        made = self.inserted.get(frame, {})
        real = len(seen) - len(made)
        box = box_around(pointing, size)
        if who in made:
            boxes = seen.boxes.copy()
            boxes[made[who]] = box
            self.detections[frame] = Detections(boxes, seen.scores, seen.histograms)
        elif not has_hypothesis(pointing, size, seen.boxes[:real]):
            self.detections[frame] = insert_hypothesis(seen, box, look)
            self.inserted[frame] = {**made, who: len(seen)}

    def _size(self, who: int, frame: int) -> Floats | None:
        """Give how large somebody was found around a frame, `(2,)` pixels across and down, in the median."""
        sides = [
            self.detections[n].boxes[self.assignments[n][who]]
            for n in range(frame - _AROUND, frame + _AROUND + 1)
            if who in self.assignments.get(n, {})
            and who not in self.inserted.get(n, {})
            and n in self.detections
        ]
        return np.median([box[2:] - box[:2] for box in sides], axis=0) if sides else None

    def record_window(self, step: WindowSnapshot) -> None:
        """Take down that a window is solved; later ones are not valid any more."""
        while self.snapshots and self.snapshots[-1].order >= step.order:
            self.snapshots.pop()
        self.snapshots.append(step)
        self._undone += [it for it in self._births if it.window >= step.order]
        self._births = [it for it in self._births if it.window < step.order]

    def record_states(self, first: int, ids: Sequence[int], states: npt.NDArray[np.int64]) -> None:
        """Take down a window's answer, `(n, M)` from the frame `first` on, -1 where hidden."""
        for m, column in enumerate(states.T.tolist()):
            self.assignments[first + m] = {
                number: state for number, state in zip(ids, column, strict=True) if state != OCCLUDED
            }

    def keep_only(self, first: int, ids: set[int]) -> None:
        """From the frame `first` on, leave out who is none of `ids`: their tracks have ended."""
        for frame in [it for it in self.assignments if it >= first]:
            self.assignments[frame] = {
                number: it for number, it in self.assignments[frame].items() if number in ids
            }

    def boxes_of(self, ids: Sequence[int], last: int, frames: int) -> Floats:
        """Give where these were in so many frames up to `last`, `(n, frames, 4)` pixels, NaN where hidden."""
        boxes = np.full((len(ids), frames, BOX_SIDES), np.nan)
        for place, frame in enumerate(range(last - frames + 1, last + 1)):
            there = self.assignments.get(frame, {})
            for n, number in enumerate(ids):
                if number in there:
                    boxes[n, place] = self.detections[frame].boxes[there[number]]
        return boxes

    def windows_since(self, frame: int) -> Sequence[WindowSnapshot]:
        """Give the windows from the first one that this frame is in; none where that is forgotten."""
        if not self.snapshots or frame < self.snapshots[0].first:
            return ()
        return [it for it in self.snapshots if it.end >= frame]

    def disagreement(self, pointing: PositionCorrection, settings: InteractiveSettings) -> float:
        """Give what an answer that follows the pointing saves in its frame; 0 where it does already."""
        if pointing.frame not in self.assignments or pointing.frame not in self.detections:
            return 0.0
        far = normalized_offset(pointing, self.detections[pointing.frame].boxes)
        state = self.assignments[pointing.frame].get(pointing.object)
        now = settings.hidden_share if state is None else float(far[state])
        return settings.correction_weight * (now - min(float(far.min(initial=1.0)), settings.hidden_share))

    def assign_id(self, frame: int, box: Floats, fresh: int) -> int:
        """Number somebody new in the window that is being solved: `fresh`, or as before it was undone.

        Without anything undone nobody ever has a number that somebody else had.
        """
        known = self._began(frame, box)
        if known is not None:
            self._undone.remove(known)
        number = fresh if known is None else known.id
        self._births.append(InitiatedTrack(frame, box, number, self.snapshots[-1].order))
        return number

    def _began(self, frame: int, box: Floats) -> InitiatedTrack | None:
        """Give who began there before, in a window that has been undone."""
        near = [it for it in self._undone if abs(it.frame - frame) <= _SAME_TIME]
        found = max(near, key=lambda it: (float(iou(it.box, box)), -it.id), default=None)
        return found if found is not None and float(iou(found.box, box)) >= _SAME_PLACE else None
