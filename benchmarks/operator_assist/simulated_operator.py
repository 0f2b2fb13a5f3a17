"""A simulated operator: sees to one flag at a time, looks after a while, and points as a hand can.

What was over before they could turn to it they see again, from a moment before, as the page offers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.operator_assist.flag_selection import FlagSelector
from benchmarks.paper_experiments.scene import ObjectTruth
from tracking.boxes import Floats, iou
from tracking.interactive import PositionCorrection, RiskEvent

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
_BACK_S = 0.5
"""Seconds before what is seen again, beside those until the hand is there."""
_FOUND = 0.2
"""Overlap (IoU) of a track's box with a body from which the operator knows who is meant."""


@dataclass(frozen=True, slots=True)
class OperatorProfile:
    """How an operator is.

    Attributes:
        reaction_s: seconds from the flag to the first pointing.
        error: how far off the pointing is, a body's size (the root of its box's area), root mean square.
        delay_s: seconds by which the picture that is shown lags behind the newest frame that is tracked.
        back_s: seconds back that they may see again, of what was over before they turned to it.
    """

    reaction_s: float = 0.5
    error: float = 1.0 / 3.0
    delay_s: float = 1.0
    back_s: float = 8.0


@dataclass(slots=True)
class OperatorFlag:
    """One flag.

    Attributes:
        trouble: why.
        object: whom the operator is asked to follow; the other one where only that is to be seen.
        raised: the newest frame when it was raised.
        until: the frame on the screen up to which it lasts at least.
        begun: the newest frame when the operator turned to it; `None`: not yet, or never.
        lag: frames that the picture lags behind in which they see to it.
        fish: who was followed in truth; `None`: nobody, yet.
        looks: the frames in which the operator pointed.
        ended: the frame on the screen when it was over; `None`: not yet.
    """

    trouble: RiskEvent
    object: int
    raised: int
    until: int
    begun: int | None = None
    lag: int = 0
    fish: int | None = None
    looks: list[int] = field(default_factory=list)
    ended: int | None = None
    clear: int = 0
    likely: dict[tuple[int, int], float] = field(default_factory=dict)


class SimulatedOperator:
    """Follows whom flags name, one at a time, on a picture that is late; never mistakes whom they follow."""

    def __init__(
        self, person: OperatorProfile, desk: FlagSelector, truth: ObjectTruth, fps: float, seed: int
    ) -> None:
        self._desk = desk
        self._person, self._truth, self._fps = person, truth, fps
        self._rng = np.random.default_rng(seed)
        self._delay = round(person.delay_s * fps)
        self._reaction = round(person.reaction_s * fps)
        self._back = round(person.back_s * fps)
        self._before = round(_BACK_S * fps) + self._reaction
        self.flags: list[OperatorFlag] = []
        self._now: OperatorFlag | None = None
        """Which the operator sees to."""

    @property
    def after(self) -> int:
        """Frames after the last one for which there is something to look at."""
        return max(self._delay, self._back)

    def hear(self, newest: int, troubles: Sequence[RiskEvent]) -> None:
        """Be told the troubles of a window, some of which raise flags."""
        now = self._now
        others = []
        for it in troubles:
            if now is not None and now.object in it.objects:
                # Who is being followed is in trouble again before the picture is there.
                now.until = max(now.until, it.frame)
            else:
                others.append(it)
        self.flags += [
            OperatorFlag(it, it.objects[0], newest, it.frame) for it in self._desk.raised(newest, others)
        ]

    def look(self, newest: int, shown: Mapping[int, Mapping[int, Floats]]) -> PositionCorrection | None:
        """Look at the screen and point at whom the flag names, if anybody can be seen there."""
        flag = self._now = self._now or self._next(newest, newest - self._delay)
        if flag is None or flag.begun is None or not 0 <= newest - flag.lag < self._truth.frames:
            return None
        pointing = self._see_to(flag, flag.begun, newest, shown)
        if flag.ended is not None:
            self._now = None
        return pointing

    def _next(self, newest: int, screen: int) -> OperatorFlag | None:
        """Turn to the flag that is due first; where none is ahead, back to what is over on the screen."""
        waiting = [it for it in self.flags if it.begun is None and it.ended is None]
        over = {id(it) for it in waiting if it.until < screen}
        for it in waiting:
            if id(it) in over and newest - it.trouble.frame + self._before > self._back:
                it.ended = screen
        left = (it for it in waiting if it.ended is None)
        flag = min(left, key=lambda it: (id(it) in over, it.until), default=None)
        if flag is not None:
            flag.begun = newest
            again = newest - flag.trouble.frame + self._before if id(flag) in over else 0
            flag.lag = max(self._delay, again)
        return flag

    def _see_to(
        self, flag: OperatorFlag, begun: int, newest: int, shown: Mapping[int, Mapping[int, Floats]]
    ) -> PositionCorrection | None:
        screen = newest - flag.lag
        if flag.fish is None:
            self._recognise(flag, shown.get(screen, {}), screen)
            if newest < begun + self._reaction:
                return None
            if not flag.likely:
                # Nobody in particular: a piece of somebody who has a number, or a weed.
                flag.ended = screen
                return None
            flag.object, flag.fish = max(flag.likely, key=lambda it: (it[0] == flag.object, flag.likely[it]))
        self._follow(flag, newest, shown.get(screen, {}).get(flag.object))
        if flag.ended is not None or self._truth.visible[flag.fish, screen] < _SEEN:
            return None
        flag.looks.append(screen)
        return self._pointing(flag, screen)

    def _recognise(self, flag: OperatorFlag, boxes: Mapping[int, Floats], screen: int) -> None:
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

    def _follow(self, flag: OperatorFlag, newest: int, box: Floats | None) -> None:
        """Let go once all is over: who is followed has been alone for a while, with the right box around."""
        screen = newest - flag.lag
        if flag.fish is not None:
            boxes = self._truth.boxes[:, screen]
            touching = np.nan_to_num(iou(boxes, boxes[flag.fish])) > _TOUCH
            alone = self._truth.visible[flag.fish, screen] >= _CLEAR and touching.sum() <= 1
            right = box is not None and iou(boxes[flag.fish], box) >= _FOUND
            flag.clear = flag.clear + 1 if alone and right else 0
        over = screen > flag.until and flag.clear >= _CLEAR_S * self._fps
        if over or newest - (flag.begun or 0) > _LONGEST_S * self._fps + flag.lag:
            flag.ended = screen

    def _pointing(self, flag: OperatorFlag, screen: int) -> PositionCorrection:
        box = self._truth.boxes[flag.fish, screen]
        size = float(np.sqrt((box[2] - box[0]) * (box[3] - box[1])))
        off = self._rng.normal(0.0, self._person.error * size / np.sqrt(2.0), 2)
        x, y = (box[:2] + box[2:]) / 2.0 + off
        return PositionCorrection(screen, flag.object, float(x), float(y), max(size / 3.0, 1.0))
