"""A tracker that is told the true positions: what a layout term could know at best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from tracking import Detections, OnlineTracker
from tracking.boxes import Floats, distance_in_heights, heights, iou
from tracking.model.network import Network
from tracking.motchallenge import MotRow

TrueBoxes = Mapping[int, Mapping[int, Floats]]
"""Of each frame: of each person, the box `(4,)`, pixels."""

_MIN_IOU = 0.4
"""Overlap from which a track's first detection is a person's."""
_FREE, _RISE = 0.3, 0.2
"""Heights off the true position that cost nothing, and over which the cost then rises to 1."""
_NEAR, _DRIFT = 1.5, 0.15
"""Companions: their distance, heights, and its change, heights per second."""


def true_boxes(truth: Sequence[MotRow]) -> dict[int, dict[int, Floats]]:
    """Return the boxes of all people, frames from 0 on."""
    frames: dict[int, dict[int, Floats]] = {}
    for row in truth:
        if row.confidence != 0.0:
            frames.setdefault(row.frame - 1, {})[row.id] = np.array(row.box)
    return frames


def true_companions(boxes: TrueBoxes, fps: float) -> dict[int, set[int]]:
    """Return who has a companion in each frame: somebody at the same relative position as a second before."""
    step = max(round(fps), 1)
    found: dict[int, set[int]] = {}
    for frame, people in boxes.items():
        before = boxes.get(frame - step, {})
        for first, second in combinations(sorted(people.keys() & before.keys()), 2):
            now = _relative(people[first], people[second])
            change = now - _relative(before[first], before[second])
            if np.hypot(*now) < _NEAR and np.hypot(*change) < _DRIFT:
                found.setdefault(frame, set()).update((first, second))
    return found


def _relative(first: Floats, second: Floats) -> Floats:
    """Return the offset of two people's feet, heights."""
    feet = [np.array([(box[0] + box[2]) / 2.0, box[3]]) for box in (first, second)]
    return np.asarray((feet[0] - feet[1]) / float(heights(np.stack([first, second])).mean()))


class TruePositionTracker(OnlineTracker):
    """The online tracker, with a cost of up to 1 for places off the true position of an object's person.

    A layout term would at best know as much, from where the others are. An object is the person whom its
    first final detection overlaps. IDF1 may still fall, where an object begins on two people, or waits for
    somebody who is not detected.
    """

    def __init__(
        self, *settings: Any, people: TrueBoxes, applies: Mapping[int, set[int]] | None, **more: Any
    ) -> None:
        """Create a tracker; the cost `applies` to these people of each frame, None: to all."""
        super().__init__(*settings, **more)
        self._people, self._applies = people, applies
        self._person: dict[int, int] = {}

    def _adjust_costs(self, network: Network, first: int, ids: list[int]) -> Network:
        node = network.node.copy()
        for n, number in enumerate(ids):
            person = self._person.get(number)
            for m in range(network.frames):
                people = self._people.get(first + m, {})
                if person is None or person not in people:
                    continue
                if self._applies is None or person in self._applies.get(first + m, ()):
                    off = distance_in_heights(people[person], network.boxes[0, m])
                    node[n, m, :-1] += np.clip((off - _FREE) / _RISE, 0.0, 1.0)
        return replace(network, node=node)

    def _finish(
        self, first: int, final_to: int, frames: Sequence[Detections], states: npt.NDArray[np.int64]
    ) -> None:
        objects = list(self._objects)
        for m in range(max(final_to - first + 1, 0)):
            people = self._people.get(first + m, {})
            for item, state in zip(objects, states[:, m], strict=True):
                if state >= 0 and item.id not in self._person and people:
                    numbers, boxes = list(people), np.stack(list(people.values()))
                    overlaps = iou(frames[m].boxes[state], boxes)
                    if overlaps.max() >= _MIN_IOU:
                        self._person[item.id] = numbers[int(overlaps.argmax())]
        super()._finish(first, final_to, frames, states)
