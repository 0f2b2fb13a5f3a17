"""Boxes of people walking along lines, for tests of the online tracker."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tracking.model.settings import CostSettings
from tracking.solvers.base import create_solver
from tracking.tracker import OnlineTracker
from tracking.types import Detections
from tracking.window import WindowResult, WindowSettings

BINS = 8
TEST_COSTS = CostSettings(displacement=2.0, displacement_unit="heights", conflict_rule="overlap")
WIDTH, HEIGHT = 30.0, 90.0


@dataclass(frozen=True)
class WalkingPerson:
    """A person walking at `speed` pixels per frame; detected in `seen`, with a high score in `sure`."""

    x: float
    y: float
    speed: float
    look: int
    seen: range = range(1_000_000)
    sure: range = range(1_000_000)

    def box(self, frame: int) -> tuple[float, float, float, float]:
        left = self.x + self.speed * frame
        return left, self.y, left + WIDTH, self.y + HEIGHT


def peaked_histogram(kind: int) -> np.ndarray:
    histogram = np.full(BINS, 0.02)
    histogram[kind % BINS] += 1.0
    return histogram / histogram.sum()


def detections_at(
    people: Iterable[WalkingPerson], frame: int, jitter: float = 0.0, seed: int = 0
) -> Detections:
    """Return the detections of a frame: all boxes, with noise of `jitter` pixels."""
    present = [person for person in people if frame in person.seen]
    if not present:
        return Detections.empty(BINS)
    rng = np.random.default_rng((seed, frame))
    boxes = np.array([person.box(frame) for person in present]) + rng.normal(0.0, jitter, (len(present), 4))
    looks = np.stack([peaked_histogram(person.look) for person in present])
    scores = np.array([0.9 if frame in person.sure else 0.5 for person in present])
    return Detections(boxes, scores, looks)


def tracker(settings: WindowSettings | None = None) -> OnlineTracker:
    return OnlineTracker(settings or WindowSettings(), TEST_COSTS, create_solver("greedy-dp"))


def track_all(stream: Sequence[Detections], tracked: OnlineTracker, start: int = 0) -> list[WindowResult]:
    """Push all frames and flush; return all results."""
    results = [tracked.push(start + n, seen) for n, seen in enumerate(stream)]
    return [result for result in [*results, tracked.flush()] if result is not None]


def final_boxes(results: Sequence[WindowResult]) -> dict[int, dict[int, np.ndarray]]:
    """Return the final box by frame and id."""
    found: dict[int, dict[int, np.ndarray]] = {}
    for result in results:
        for track in result.tracks:
            for frame in range(result.first, result.final_to + 1):
                box = track.boxes[frame - result.first]
                if not np.isnan(box[0]):
                    found.setdefault(frame, {})[track.id] = box
    return found
