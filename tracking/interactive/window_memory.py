"""The past seconds of a tracker: what was seen in them, and where it stood before each of its windows."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import BOX_SIDES, Floats, iou
from tracking.interactive.corrections import Pointing, farness
from tracking.interactive.hypothesis_insertion import is_found, place_of, with_place
from tracking.interactive.settings import AssistSettings
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
class Step:
    """A window about to be solved.

    Attributes:
        first: its first frame.
        end: its last frame.
        final_to: the last frame that becomes final.
        objects: the object list before it.
        told: what the window before it has told.
    """

    first: int
    end: int
    final_to: int
    objects: tuple[TrackedObject, ...]
    told: WindowWarmStart | None

    @property
    def window(self) -> tuple[int, int]:
        """Which window it is: they come in this order."""
        return self.end, self.final_to


@dataclass(frozen=True, slots=True, eq=False)
class Began:
    """Somebody new: where and when, the number that they were given, and the window that it was in."""

    frame: int
    box: Floats
    id: int
    window: tuple[int, int]


class Memory:
    """What a tracker needs to go back by up to `frames` frames. Bounded by them.

    Attributes:
        seen: the detections, by frame; a frame that is not there showed nothing.
        where: who was in which of them in the end, by frame: the observation's index by id.
        places: what was made of pointings, by frame: the observation's index by whom it was made for.
        steps: the windows, oldest first.
    """

    def __init__(self, frames: int) -> None:
        self._frames = frames
        self._births: list[Began] = []
        self._undone: list[Began] = []
        """Those whose windows are solved again: who begins there once more has their number."""
        self.seen: dict[int, Detections] = {}
        self.where: dict[int, Mapping[int, int]] = {}
        self.places: dict[int, dict[int, int]] = {}
        self.steps: deque[Step] = deque()

    def look(self, frame: int, detections: Detections) -> None:
        """Take the detections of a frame, and forget what is too long ago."""
        self.seen[frame] = detections
        oldest = frame - self._frames
        # Of a window that reaches back beyond the memory, the detections are needed, too.
        while self.steps and self.steps[0].end < oldest:
            self.steps.popleft()
        oldest = min(oldest, self.steps[0].first if self.steps else frame)
        self.seen = {number: it for number, it in self.seen.items() if number >= oldest}
        self.where = {number: it for number, it in self.where.items() if number >= oldest}
        self.places = {number: it for number, it in self.places.items() if number >= oldest}
        self._births = [it for it in self._births if it.frame >= oldest - _SAME_TIME]
        self._undone = [it for it in self._undone if it.frame >= oldest - _SAME_TIME]

    def place(self, pointing: Pointing, look: Floats) -> None:
        """Make a place for who is pointed at, where nothing like them is found, or move what was made."""
        frame, who = pointing.frame, pointing.object
        size, seen = self._size(who, frame), self.seen.get(frame)
        if size is None or seen is None:
            return
        made = self.places.get(frame, {})
        real = len(seen) - len(made)
        box = place_of(pointing, size)
        if who in made:
            boxes = seen.boxes.copy()
            boxes[made[who]] = box
            self.seen[frame] = Detections(boxes, seen.scores, seen.histograms)
        elif not is_found(pointing, size, seen.boxes[:real]):
            self.seen[frame] = with_place(seen, box, look)
            self.places[frame] = {**made, who: len(seen)}

    def _size(self, who: int, frame: int) -> Floats | None:
        """Give how large somebody was found around a frame, `(2,)` pixels across and down, in the median."""
        sides = [
            self.seen[n].boxes[self.where[n][who]]
            for n in range(frame - _AROUND, frame + _AROUND + 1)
            if who in self.where.get(n, {}) and who not in self.places.get(n, {}) and n in self.seen
        ]
        return np.median([box[2:] - box[:2] for box in sides], axis=0) if sides else None

    def step(self, step: Step) -> None:
        """Take down that a window is solved; later ones are not valid any more."""
        while self.steps and self.steps[-1].window >= step.window:
            self.steps.pop()
        self.steps.append(step)
        self._undone += [it for it in self._births if it.window >= step.window]
        self._births = [it for it in self._births if it.window < step.window]

    def found(self, first: int, ids: Sequence[int], states: npt.NDArray[np.int64]) -> None:
        """Take down a window's answer, `(n, M)` from the frame `first` on, -1 where hidden."""
        for m, column in enumerate(states.T.tolist()):
            self.where[first + m] = {
                number: state for number, state in zip(ids, column, strict=True) if state != OCCLUDED
            }

    def settle(self, first: int, ids: set[int]) -> None:
        """From the frame `first` on, leave out who is none of `ids`: their tracks have ended."""
        for frame in [it for it in self.where if it >= first]:
            self.where[frame] = {number: it for number, it in self.where[frame].items() if number in ids}

    def trail(self, ids: Sequence[int], last: int, frames: int) -> Floats:
        """Give where these were in so many frames up to `last`, `(n, frames, 4)` pixels, NaN where hidden."""
        boxes = np.full((len(ids), frames, BOX_SIDES), np.nan)
        for place, frame in enumerate(range(last - frames + 1, last + 1)):
            there = self.where.get(frame, {})
            for n, number in enumerate(ids):
                if number in there:
                    boxes[n, place] = self.seen[frame].boxes[there[number]]
        return boxes

    def since(self, frame: int) -> Sequence[Step]:
        """Give the windows from the first one that this frame is in; none where that is forgotten."""
        if not self.steps or frame < self.steps[0].first:
            return ()
        return [it for it in self.steps if it.end >= frame]

    def doubt(self, pointing: Pointing, settings: AssistSettings) -> float:
        """Give what an answer that follows the pointing saves in its frame; 0 where it does already."""
        if pointing.frame not in self.where or pointing.frame not in self.seen:
            return 0.0
        far = farness(pointing, self.seen[pointing.frame].boxes)
        state = self.where[pointing.frame].get(pointing.object)
        now = settings.hidden if state is None else float(far[state])
        return settings.weight * (now - min(float(far.min(initial=1.0)), settings.hidden))

    def number(self, frame: int, box: Floats, fresh: int) -> int:
        """Number somebody new in the window that is being solved: `fresh`, or as before it was undone.

        Without anything undone nobody ever has a number that somebody else had.
        """
        known = self._began(frame, box)
        if known is not None:
            self._undone.remove(known)
        number = fresh if known is None else known.id
        self._births.append(Began(frame, box, number, self.steps[-1].window))
        return number

    def _began(self, frame: int, box: Floats) -> Began | None:
        """Give who began there before, in a window that has been undone."""
        near = [it for it in self._undone if abs(it.frame - frame) <= _SAME_TIME]
        found = max(near, key=lambda it: (float(iou(it.box, box)), -it.id), default=None)
        return found if found is not None and float(iou(found.box, box)) >= _SAME_PLACE else None
