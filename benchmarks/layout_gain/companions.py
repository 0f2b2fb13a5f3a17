"""A layout term between companions: who walked together goes on at the same relative position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from tracking import Detections, OnlineTracker
from tracking.boxes import Floats, heights
from tracking.model.network import Network
from tracking.solvers.base import OCCLUDED


@dataclass(frozen=True, slots=True)
class CompanionSettings:
    """Who walks together, and what it costs to part.

    Attributes:
        weight: cost of a place where no companion expects the object.
        memory_s: seconds over which two people are compared.
        min_shared: share of that time in which both were detected.
        near: their largest distance, heights.
        drift: largest change of the relative position of companions, heights per second.
        speed: least speed of companions, heights per second: who stands needs nobody else to be found.
        slack: error of boxes, heights.
        rise: heights beyond slack and drift over which the cost rises to the weight.
    """

    weight: float = 0.3
    memory_s: float = 2.0
    min_shared: float = 0.6
    near: float = 2.0
    drift: float = 0.15
    speed: float = 0.3
    slack: float = 0.15
    rise: float = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Companion:
    """Where one object expects another.

    Attributes:
        offset: `(2,)` pixels from the former's feet to the latter's.
        height: pixels, the mean of both.
        last: the frame of that offset.
    """

    offset: Floats
    height: float
    last: int


def find_companion(
    of: Mapping[int, Floats], other: Mapping[int, Floats], fps: float, settings: CompanionSettings
) -> Companion | None:
    """Return where `other` expects `of`, if they walked together; both are boxes by frame number."""
    memory = max(round(settings.memory_s * fps), 3)
    shared = sorted(of.keys() & other.keys())[-memory:]
    if len(shared) < settings.min_shared * memory:
        return None
    both = np.array([[of[frame] for frame in shared], [other[frame] for frame in shared]])
    height = float(np.median(heights(both)))
    feet = _feet(both) / height
    third = max(len(shared) // 3, 1)
    relative = feet[0] - feet[1]
    seconds = max((shared[-1] - shared[0]) / fps, 0.3)
    walked, parted = (
        float(np.hypot(*(path[-third:].mean(axis=0) - path[:third].mean(axis=0)))) / seconds
        for path in (feet[0], relative)
    )
    apart = float(np.hypot(*relative.mean(axis=0)))
    if apart > settings.near or parted > settings.drift or walked < settings.speed:
        return None
    return Companion(relative[-third:].mean(axis=0) * height, height, shared[-1])


def departure_costs(
    boxes: Floats, expected: Floats, companion: Companion, first: int, fps: float, settings: CompanionSettings
) -> Floats:
    """Return the cost `(M, K)` of boxes `(M, K, 4)`; `expected` `(M, 2)` are feet, NaN where nobody tells."""
    elapsed = (first + np.arange(len(boxes)) - companion.last) / fps
    off = np.hypot(*np.moveaxis(_feet(boxes) - expected[:, None], -1, 0)) / companion.height
    beyond = off - settings.slack - settings.drift * elapsed[:, None]
    return np.asarray(np.nan_to_num(settings.weight * np.clip(beyond / settings.rise, 0.0, 1.0)))


def _feet(boxes: Floats) -> Floats:
    return np.stack([(boxes[..., 0] + boxes[..., 2]) / 2.0, boxes[..., 3]], axis=-1)


class CompanionTracker(OnlineTracker):
    """The online tracker, whose windows are solved again with the cost of parting from companions.

    The companions' places are those of the first solution, so that the program remains one of paths.
    """

    def __init__(self, *settings: Any, companions: CompanionSettings, **more: Any) -> None:
        super().__init__(*settings, **more)
        self._companions = companions
        self._paths: dict[int, dict[int, Floats]] = {}

    def _adjust_costs(self, network: Network, first: int, ids: list[int]) -> Network:
        fps, settings = self._window.fps, self._companions
        pairs = [
            (a, b, found)
            for a, b in combinations(range(len(ids)), 2)
            for found in [find_companion(self._path(ids[a]), self._path(ids[b]), fps, settings)]
            if found is not None
        ]
        if not pairs:
            return network
        warm_start = self._warm_start.for_window(first, ids) if self._warm_start else None
        states = self._solver.solve(network, warm_start).states
        feet = _feet(network.boxes[0][np.arange(network.frames), np.maximum(states, 0)])
        feet[states == OCCLUDED] = np.nan
        counts = np.bincount([n for a, b, _ in pairs for n in (a, b)], minlength=len(ids))
        node = network.node.copy()
        for a, b, found in pairs:
            for n, other, sign in ((a, b, 1.0), (b, a, -1.0)):
                expected = feet[other] + sign * found.offset
                costs = departure_costs(network.boxes[0], expected, found, first, fps, settings)
                node[n, :, :-1] += costs / max(counts[a], counts[b])
        return replace(network, node=node)

    def _path(self, number: int) -> Mapping[int, Floats]:
        return self._paths.get(number, {})

    def _finish(
        self, first: int, final_to: int, frames: Sequence[Detections], states: npt.NDArray[np.int64]
    ) -> None:
        objects = list(self._objects)
        for m in range(max(final_to - first + 1, 0)):
            for item, state in zip(objects, states[:, m], strict=True):
                if state != OCCLUDED:
                    self._paths.setdefault(item.id, {})[first + m] = frames[m].boxes[state]
        super()._finish(first, final_to, frames, states)
        oldest = final_to - 2 * round(self._companions.memory_s * self._window.fps)
        self._paths = {
            item.id: {frame: box for frame, box in self._path(item.id).items() if frame > oldest}
            for item in self._objects
        }
