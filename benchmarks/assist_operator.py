"""A simulated operator: is shown one flag at a time, looks after a while, and points as a hand can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.experiments_scene import Truth
from tracking.assist import Pointing, Trouble
from tracking.boxes import Floats, iou

_SEEN = 0.15
"""Share of a body that must be visible for anybody to point at it."""
_CLEAR = 0.8
"""Share of a body from which it stands alone again."""
_TOUCH = 0.1
"""Overlap (IoU) with another body up to which it does."""
_CLEAR_S = 0.3
"""Seconds for which it must."""
_LONGEST_S = 5.0
"""Seconds after which the operator lets go."""
_FOUND = 0.2
"""Overlap (IoU) of a track's box with a body from which the operator knows who is meant."""


@dataclass(frozen=True, slots=True)
class Person:
    """How an operator is.

    Attributes:
        reaction_s: seconds from the flag to the first pointing.
        error: how far off the pointing is, a body's size (the root of its box's area), root mean square.
        delay_s: seconds by which the picture that is shown lags behind the newest frame that is tracked.
    """

    reaction_s: float = 0.5
    error: float = 1.0 / 3.0
    delay_s: float = 1.0


@dataclass(slots=True)
class Flag:
    """One flag.

    Attributes:
        trouble: why.
        object: whom the operator is asked to follow; the other one where only that is to be seen.
        raised: the newest frame when it was raised.
        until: the frame on the screen up to which it lasts at least.
        fish: who was followed in truth; `None`: nobody, yet.
        looks: the frames in which the operator pointed.
        ended: the frame on the screen when it was over; `None`: not yet.
    """

    trouble: Trouble
    object: int
    raised: int
    until: int
    fish: int | None = None
    looks: list[int] = field(default_factory=list)
    ended: int | None = None
    clear: int = 0
    likely: dict[tuple[int, int], float] = field(default_factory=dict)


class Operator:
    """Follows whom flags name, one at a time, on a picture that is late; never mistakes whom they follow."""

    def __init__(self, person: Person, truth: Truth, fps: float, seed: int) -> None:
        self._person, self._truth, self._fps = person, truth, fps
        self._rng = np.random.default_rng(seed)
        self._delay = round(person.delay_s * fps)
        self._reaction = round(person.reaction_s * fps)
        self.flags: list[Flag] = []
        self.missed: list[Trouble] = []
        """What was foreseen while the operator was busy."""

    @property
    def delay(self) -> int:
        """Frames that the picture lags behind."""
        return self._delay

    def hear(self, newest: int, troubles: Sequence[Trouble]) -> None:
        """Be told the troubles of a window; the worst in time raises a flag."""
        for trouble in troubles:
            if self.flags and self.flags[-1].ended is None and self.flags[-1].object in trouble.objects:
                # Who is being followed is in trouble again before the picture is there.
                self.flags[-1].until = max(self.flags[-1].until, trouble.frame)
            if self._told(trouble):
                continue
            if self.flags and self.flags[-1].ended is None:
                self.missed.append(trouble)
                continue
            self.flags.append(Flag(trouble, trouble.objects[0], newest, trouble.frame))

    def _told(self, trouble: Trouble) -> bool:
        """Say whether a flag is about this already: about one of these, until it is over."""
        return any(
            {*it.trouble.objects} & {*trouble.objects} and (it.ended is None or it.ended >= trouble.frame)
            for it in self.flags
        )

    def look(self, newest: int, shown: Mapping[int, Mapping[int, Floats]]) -> Pointing | None:
        """Look at the screen and point at whom the flag names, if anybody can be seen there."""
        screen = newest - self._delay
        if not self.flags or self.flags[-1].ended is not None or screen < 0:
            return None
        flag = self.flags[-1]
        if screen >= self._truth.frames:
            return None
        if flag.fish is None:
            self._recognise(flag, shown.get(screen, {}), screen)
            if newest < flag.raised + self._reaction:
                return None
            if not flag.likely:
                # Nobody in particular: a piece of somebody who has a number, or a weed.
                flag.ended = screen
                return None
            flag.object, flag.fish = max(flag.likely, key=lambda it: (it[0] == flag.object, flag.likely[it]))
        self._follow(flag, screen, newest, shown.get(screen, {}).get(flag.object))
        if flag.fish is None or flag.ended is not None or self._truth.visible[flag.fish, screen] < _SEEN:
            return None
        flag.looks.append(screen)
        return self._pointing(flag, screen)

    def _recognise(self, flag: Flag, boxes: Mapping[int, Floats], screen: int) -> None:
        """See whose boxes the tracks' are on the screen, while the hand is on its way."""
        numbers = list(boxes)
        if not numbers:
            return
        overlaps = np.nan_to_num(
            iou(self._truth.boxes[:, screen, None], np.stack([boxes[k] for k in numbers])[None])
        )
        overlaps *= self._truth.visible[:, screen, None]
        for fish, row in enumerate(overlaps):
            best = int(row.argmax())
            if row[best] >= _FOUND and numbers[best] in flag.trouble.objects:
                it = numbers[best], fish
                flag.likely[it] = flag.likely.get(it, 0.0) + float(row[best])

    def _follow(self, flag: Flag, screen: int, newest: int, box: Floats | None) -> None:
        """Let go once all is over: who is followed has been alone for a while, with the right box around."""
        if flag.fish is not None:
            boxes = self._truth.boxes[:, screen]
            touching = np.nan_to_num(iou(boxes, boxes[flag.fish])) > _TOUCH
            alone = self._truth.visible[flag.fish, screen] >= _CLEAR and touching.sum() <= 1
            right = box is not None and iou(boxes[flag.fish], box) >= _FOUND
            flag.clear = flag.clear + 1 if alone and right else 0
        over = screen > flag.until and flag.clear >= _CLEAR_S * self._fps
        if over or newest - flag.raised > (_LONGEST_S + self._person.delay_s) * self._fps:
            flag.ended = screen

    def _pointing(self, flag: Flag, screen: int) -> Pointing:
        box = self._truth.boxes[flag.fish, screen]
        size = float(np.sqrt((box[2] - box[0]) * (box[3] - box[1])))
        off = self._rng.normal(0.0, self._person.error * size / np.sqrt(2.0), 2)
        x, y = (box[:2] + box[2:]) / 2.0 + off
        return Pointing(screen, flag.object, float(x), float(y), max(size / 3.0, 1.0))
