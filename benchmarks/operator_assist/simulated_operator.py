"""A simulated operator, who handles one flag at a time, with a reaction time and pointing errors.

Risk events that passed before the operator turned to them are replayed, as the page offers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.operator_assist.flag_selection import FlagSelector
from benchmarks.paper_experiments.scene import ObjectTruth
from tracking.boxes import Floats, iou
from tracking.interactive import PositionCorrection, RiskEvent

_MIN_VISIBLE = 0.15
"""Visible share of a body from which the operator can point at it."""
_CLEAR = 0.8
"""Visible share of a body from which it is alone again."""
_TOUCH = 0.1
"""Overlap (IoU) with another body up to which it is alone."""
_CLEAR_S = 0.3
"""Seconds for which it must be alone."""
_LONGEST_S = 5.0
"""Seconds after which the operator gives up."""
_BACK_S = 0.5
"""Seconds of replay before a risk event, besides the reaction time."""
_RECOGNIZED_IOU = 0.2
"""Overlap (IoU) of a track's box with a body from which the operator recognizes it."""


@dataclass(frozen=True, slots=True)
class OperatorProfile:
    """The properties of an operator.

    Attributes:
        reaction_s: seconds from the flag to the first correction.
        error: root mean square error of pointing, in body sizes (the root of a box's area).
        delay_s: delay of the shown picture behind the newest tracked frame.
        back_s: seconds that the operator can go back.
    """

    reaction_s: float = 0.5
    error: float = 1.0 / 3.0
    delay_s: float = 1.0
    back_s: float = 8.0


@dataclass(slots=True)
class OperatorFlag:
    """A flag and how the operator handled it.

    Attributes:
        event: the risk event.
        object: the track to follow; the other one where only that is visible.
        raised: the newest frame when it was raised.
        until: the frame on the screen up to which it lasts at least.
        begun: the newest frame when the operator turned to it; `None`: not yet, or never.
        lag: delay of the operator's picture, frames.
        fish: the fish that was followed; `None`: none yet.
        pointing_frames: the frames in which the operator pointed.
        ended: the frame on the screen when it was over; `None`: not yet.
    """

    event: RiskEvent
    object: int
    raised: int
    until: int
    begun: int | None = None
    lag: int = 0
    fish: int | None = None
    pointing_frames: list[int] = field(default_factory=list)
    ended: int | None = None
    clear: int = 0
    likely: dict[tuple[int, int], float] = field(default_factory=dict)


class SimulatedOperator:
    """Follows flagged fish, one at a time, on a delayed picture, and never loses them."""

    def __init__(
        self, person: OperatorProfile, selector: FlagSelector, truth: ObjectTruth, fps: float, seed: int
    ) -> None:
        self._selector = selector
        self._person, self._truth, self._fps = person, truth, fps
        self._rng = np.random.default_rng(seed)
        self._delay = round(person.delay_s * fps)
        self._reaction = round(person.reaction_s * fps)
        self._back = round(person.back_s * fps)
        self._before = round(_BACK_S * fps) + self._reaction
        self.flags: list[OperatorFlag] = []
        self._now: OperatorFlag | None = None
        """The flag that the operator handles."""

    @property
    def after(self) -> int:
        """Frames after the last one in which the operator is still busy."""
        return max(self._delay, self._back)

    def receive(self, newest: int, risk_events: Sequence[RiskEvent]) -> None:
        """Receive the risk events of a window, some of which raise flags."""
        now = self._now
        others = []
        for event in risk_events:
            if now is not None and now.object in event.objects:
                # The followed fish has another risk event before the picture shows it.
                now.until = max(now.until, event.frame)
            else:
                others.append(event)
        self.flags += [
            OperatorFlag(event, event.objects[0], newest, event.frame)
            for event in self._selector.raised(newest, others)
        ]

    def point(self, newest: int, shown: Mapping[int, Mapping[int, Floats]]) -> PositionCorrection | None:
        """Look at the screen, and point at the flagged fish if it is visible."""
        flag = self._now = self._now or self._next_flag(newest, newest - self._delay)
        if flag is None or flag.begun is None or not 0 <= newest - flag.lag < self._truth.frames:
            return None
        pointing = self._handle(flag, flag.begun, newest, shown)
        if flag.ended is not None:
            self._now = None
        return pointing

    def _next_flag(self, newest: int, screen: int) -> OperatorFlag | None:
        """Turn to the flag that is due first; without any, to one that has passed on the screen."""
        waiting = [flag for flag in self.flags if flag.begun is None and flag.ended is None]
        over = {id(flag) for flag in waiting if flag.until < screen}
        for it in waiting:
            if id(it) in over and newest - it.event.frame + self._before > self._back:
                it.ended = screen
        left = (flag for flag in waiting if flag.ended is None)
        flag = min(left, key=lambda flag: (id(flag) in over, flag.until), default=None)
        if flag is not None:
            flag.begun = newest
            again = newest - flag.event.frame + self._before if id(flag) in over else 0
            flag.lag = max(self._delay, again)
        return flag

    def _handle(
        self, flag: OperatorFlag, begun: int, newest: int, shown: Mapping[int, Mapping[int, Floats]]
    ) -> PositionCorrection | None:
        screen = newest - flag.lag
        if flag.fish is None:
            self._recognize(flag, shown.get(screen, {}), screen)
            if newest < begun + self._reaction:
                return None
            if not flag.likely:
                # No fish in particular: a part of a known fish, or a weed.
                flag.ended = screen
                return None
            flag.object, flag.fish = max(
                flag.likely, key=lambda guess: (guess[0] == flag.object, flag.likely[guess])
            )
        self._follow(flag, newest, shown.get(screen, {}).get(flag.object))
        if flag.ended is not None or self._truth.visible[flag.fish, screen] < _MIN_VISIBLE:
            return None
        flag.pointing_frames.append(screen)
        return self._pointing(flag, screen)

    def _recognize(self, flag: OperatorFlag, boxes: Mapping[int, Floats], screen: int) -> None:
        """Accumulate the overlap of the flagged tracks' boxes with the fish on the screen."""
        numbers = list(boxes)
        if not numbers:
            return
        overlaps = np.nan_to_num(
            iou(self._truth.boxes[:, screen, None], np.stack([boxes[k] for k in numbers])[None])
        )
        overlaps *= self._truth.visible[:, screen, None]
        for fish, row in enumerate(overlaps):
            best = int(row.argmax())
            if row[best] >= _RECOGNIZED_IOU and numbers[best] in flag.event.objects:
                it = numbers[best], fish
                flag.likely[it] = flag.likely.get(it, 0.0) + float(row[best])

    def _follow(self, flag: OperatorFlag, newest: int, box: Floats | None) -> None:
        """End the flag once the followed fish has been alone for a while with the right box."""
        screen = newest - flag.lag
        if flag.fish is not None:
            boxes = self._truth.boxes[:, screen]
            touching = np.nan_to_num(iou(boxes, boxes[flag.fish])) > _TOUCH
            alone = self._truth.visible[flag.fish, screen] >= _CLEAR and touching.sum() <= 1
            right = box is not None and iou(boxes[flag.fish], box) >= _RECOGNIZED_IOU
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
