"""Track initiation: the backward and forward test of paper II.E."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats, iou
from tracking.lifecycle.gating import gate_detections, restrict_network, within_gate
from tracking.model.network import CostSettings, build_network
from tracking.model.object_state import Template, TrackedObject, mean_histogram
from tracking.solvers.base import OCCLUDED, Solver
from tracking.types import Detections
from tracking.window import ResolvedWindowSettings

# Least share of the frames visible in either track in which backward and forward track agree.
_MIN_AGREEMENT = 0.8
_MIN_SAME_IOU = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Birth:
    """A consistent object without a track.

    Attributes:
        histogram: `(B,)` mean appearance along its path.
        box: `(4,)` pixels, the start of its path.
        offset: index of that frame in the window.
    """

    histogram: Floats
    box: Floats
    offset: int


def find_births(
    frames: Sequence[Detections],
    occupied: Sequence[Floats],
    window: ResolvedWindowSettings,
    costs: CostSettings,
    solver: Solver,
) -> list[Birth]:
    """Find new objects in the unassigned detections of a window.

    Args:
        frames: the detections of the test period.
        occupied: the boxes of the tracks in each of these frames, `(T_m, 4)`.
        window: the thresholds.
        costs: the costs of a path.
        solver: solver for a network of one object.
    """
    if len(frames) < window.birth_window:
        return []
    test = _BirthTest(window, costs, solver)
    unassigned = [
        _unassigned_detections(detections, boxes, window)
        for detections, boxes in zip(frames, occupied, strict=True)
    ]
    births: list[Birth] = []
    tries = 0
    # A path that ends earlier is too short.
    earliest = _required_frames(window) - 1
    for last in range(len(frames) - 1, earliest - 1, -1):
        tried = np.zeros(len(unassigned[last]), dtype=np.bool_)
        while tries < window.birth_max_tests and not tried.all():
            seed = int(np.argmax(np.where(tried, -1.0, unassigned[last].scores)))
            tried[seed] = True
            if not test.promising(unassigned, last, seed):
                continue
            tries += 1
            path = test.run(unassigned, last, seed)
            if path is not None:
                births.append(_birth_from_path(unassigned, path))
                claimed = [
                    unassigned[m].boxes[[k]] if k != OCCLUDED else np.empty((0, 4))
                    for m, k in enumerate(path)
                ]
                unassigned = [
                    _unassigned_detections(detections, boxes, window)
                    for detections, boxes in zip(unassigned, claimed, strict=True)
                ]
                tried = np.zeros(len(unassigned[last]), dtype=np.bool_)
    return births


def _required_frames(window: ResolvedWindowSettings) -> int:
    """Return the number of frames in which a new object must be detected."""
    return int(np.ceil(window.birth_min_visible * window.birth_window))


def _unassigned_detections(
    detections: Detections, boxes: Floats, window: ResolvedWindowSettings
) -> Detections:
    """Return the confident detections of a frame that overlap no known object."""
    kept = detections.scores >= window.birth_min_score
    if len(boxes) and len(detections):
        kept &= iou(detections.boxes[:, None], boxes[None]).max(axis=1) < window.birth_max_iou
    return Detections(detections.boxes[kept], detections.scores[kept], detections.histograms[kept])


def _birth_from_path(frames: Sequence[Detections], path: npt.NDArray[np.int64]) -> Birth:
    visible = [m for m, index in enumerate(path) if index != OCCLUDED]
    first = visible[0]
    histograms = np.stack([frames[m].histograms[path[m]] for m in visible])
    return Birth(mean_histogram(histograms), frames[first].boxes[path[first]], first)


@dataclass(frozen=True, slots=True, eq=False)
class _BirthTest:
    window: ResolvedWindowSettings
    costs: CostSettings
    solver: Solver

    def promising(self, frames: Sequence[Detections], last: int, seed: int) -> bool:
        """Return whether enough frames have a detection near the seed; a cheap test before solving."""
        numbers = np.repeat(np.arange(len(frames)), [len(detections) for detections in frames])
        boxes = np.concatenate([detections.boxes for detections in frames])
        near = within_gate(frames[last].boxes[seed], boxes, np.abs(last - numbers), self.window)
        return len(np.unique(numbers[near])) >= _required_frames(self.window)

    def run(self, frames: Sequence[Detections], last: int, seed: int) -> npt.NDArray[np.int64] | None:
        """Track backward from the seed, then forward from the end of that track; `None` unless they agree."""
        backward = self._track(frames[: last + 1][::-1], 0, seed)[::-1]
        visible = np.flatnonzero(backward != OCCLUDED)
        if len(visible) < _required_frames(self.window):
            return None
        first = int(visible[0])
        forward = self._track(frames[first:], 0, int(backward[first]))
        path = np.concatenate([np.full(first, OCCLUDED), forward])
        if np.count_nonzero(path != OCCLUDED) < _required_frames(self.window):
            return None
        peak = max(detections.scores[k] for detections, k in zip(frames, path, strict=True) if k != OCCLUDED)
        if peak < self.window.birth_min_peak_score:
            return None
        return path if self._agree(frames[: last + 1], backward, path[: last + 1]) else None

    def _track(self, frames: Sequence[Detections], start: int, seed: int) -> npt.NDArray[np.int64]:
        """Track one detection of the first frame through the others; occluded everywhere if too costly."""
        found = np.full(len(frames), OCCLUDED)
        found[start] = seed
        if len(frames) == 1:
            return found
        box, histogram = frames[0].boxes[seed], frames[0].histograms[seed]
        later = list(frames[1:])
        network = build_network([Template(0, histogram, box)], later, self.costs)
        allowed = gate_detections([TrackedObject(0, histogram, box, 0)], 1, later, self.window)
        solution = self.solver.solve(restrict_network(network, allowed))
        found[1:] = solution.states[0]
        occluded = np.count_nonzero(found == OCCLUDED)
        # The cost of the visible frames: the path's cost minus that of occluded frames and of the sink.
        constant = self.costs.hidden
        visible = len(later) - occluded
        cost = solution.report.objective - constant * (occluded + 1)
        if visible and cost / visible > self.window.birth_max_cost:
            found[1:] = OCCLUDED
        return found

    def _agree(
        self, frames: Sequence[Detections], first: npt.NDArray[np.int64], second: npt.NDArray[np.int64]
    ) -> bool:
        either, both = 0, 0
        for detections, one, other in zip(frames, first, second, strict=True):
            either += one != OCCLUDED or other != OCCLUDED
            if OCCLUDED not in {one, other}:
                same = one == other or iou(detections.boxes[one], detections.boxes[other]) >= _MIN_SAME_IOU
                both += bool(same)
        return both >= _MIN_AGREEMENT * either
