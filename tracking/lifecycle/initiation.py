"""Track initiation: the backward and forward test of paper II.E."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats, iou
from tracking.lifecycle.gating import restrict_network, within_gate
from tracking.model.network import CostSettings, build_network
from tracking.model.object_state import Template, mean_histogram
from tracking.solvers.base import OCCLUDED, Solver
from tracking.types import Detections
from tracking.window import WindowSettings

# Share of the frames seen by either that the backward and the forward track must have in common.
_MIN_AGREEMENT = 0.8
_SAME_PLACE_IOU = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Birth:
    """A consistent object that no track of the window is on.

    Attributes:
        histogram: `(B,)` mean appearance along its path.
        box: `(4,)` pixels where its path begins.
        offset: index in the window of that frame.
    """

    histogram: Floats
    box: Floats
    offset: int


def find_births(
    frames: Sequence[Detections],
    taken: Sequence[Floats],
    window: WindowSettings,
    costs: CostSettings,
    solver: Solver,
) -> list[Birth]:
    """Find new objects in the detections that the tracks of a window leave over.

    Args:
        frames: the detections of the test period.
        taken: the boxes of the tracks in each of these frames, `(T_m, 4)`.
        window: the thresholds.
        costs: the costs of a path.
        solver: for a network of one object.
    """
    if len(frames) < window.birth_window:
        return []
    test = _BirthTest(window, costs, solver)
    left = [_unassigned_detections(seen, boxes, window) for seen, boxes in zip(frames, taken, strict=True)]
    births: list[Birth] = []
    latest = max(len(frames) - _required_frames(window), 1)  # who must be seen in all of them is in the last
    tries = 0
    for last in range(len(frames) - 1, max(len(frames) - 1 - latest, -1), -1):
        tried = np.zeros(len(left[last]), dtype=np.bool_)
        while tries < window.birth_max_tests and not tried.all():
            seed = int(np.argmax(np.where(tried, -1.0, left[last].scores)))
            tried[seed] = True
            if not test.promising(left, last, seed):
                continue
            tries += 1
            path = test.run(left, last, seed)
            if path is not None:
                births.append(_birth_from_path(left, path))
                gone = [left[m].boxes[[k]] if k != OCCLUDED else np.empty((0, 4)) for m, k in enumerate(path)]
                left = [
                    _unassigned_detections(seen, boxes, window)
                    for seen, boxes in zip(left, gone, strict=True)
                ]
                tried = np.zeros(len(left[last]), dtype=np.bool_)
    return births


def _required_frames(window: WindowSettings) -> int:
    """Return in how many frames a new object must be seen."""
    return int(np.ceil(window.birth_min_visible * window.birth_window))


def _unassigned_detections(seen: Detections, boxes: Floats, window: WindowSettings) -> Detections:
    """Return the sure detections of a frame that are not where somebody known is."""
    sure = seen.scores >= window.birth_min_score
    if len(boxes) and len(seen):
        sure &= iou(seen.boxes[:, None], boxes[None]).max(axis=1) < window.birth_max_iou
    return Detections(seen.boxes[sure], seen.scores[sure], seen.histograms[sure])


def _birth_from_path(frames: Sequence[Detections], path: npt.NDArray[np.int64]) -> Birth:
    seen = [m for m, place in enumerate(path) if place != OCCLUDED]
    looks = np.stack([frames[m].histograms[path[m]] for m in seen])
    return Birth(mean_histogram(looks), frames[seen[0]].boxes[path[seen[0]]], seen[0])


@dataclass(frozen=True, slots=True, eq=False)
class _BirthTest:
    window: WindowSettings
    costs: CostSettings
    solver: Solver

    def promising(self, frames: Sequence[Detections], last: int, seed: int) -> bool:
        """Return whether enough frames have anything near the seed: cheap, before anything is solved."""
        box = frames[last].boxes[seed]
        hits = sum(
            bool(within_gate(box, seen.boxes, abs(last - m), self.window).any())
            for m, seen in enumerate(frames)
        )
        return hits >= _required_frames(self.window)

    def run(self, frames: Sequence[Detections], last: int, seed: int) -> npt.NDArray[np.int64] | None:
        """Track backward from the seed, then forward from where that ends; `None` unless they agree."""
        backward = self._track(frames[: last + 1][::-1], 0, seed)[::-1]
        seen = np.flatnonzero(backward != OCCLUDED)
        if len(seen) < _required_frames(self.window):
            return None
        first = int(seen[0])
        forward = self._track(frames[first:], 0, int(backward[first]))
        path = np.concatenate([np.full(first, OCCLUDED), forward])
        if np.count_nonzero(path != OCCLUDED) < _required_frames(self.window):
            return None
        sure = max(seen.scores[k] for seen, k in zip(frames, path, strict=True) if k != OCCLUDED)
        if sure < self.window.birth_min_peak_score:
            return None
        return path if self._agree(frames[: last + 1], backward, path[: last + 1]) else None

    def _track(self, frames: Sequence[Detections], start: int, seed: int) -> npt.NDArray[np.int64]:
        """Follow one detection of the first frame through the others; hidden everywhere if too costly."""
        found = np.full(len(frames), OCCLUDED)
        found[start] = seed
        if len(frames) == 1:
            return found
        box, histogram = frames[0].boxes[seed], frames[0].histograms[seed]
        rest = list(frames[1:])
        network = build_network([Template(0, histogram, box)], rest, self.costs)
        allowed = [within_gate(box, seen.boxes, m + 1, self.window) for m, seen in enumerate(rest)]
        solution = self.solver.solve(restrict_network(network, [allowed]))
        found[1:] = solution.states[0]
        hidden = np.count_nonzero(found == OCCLUDED)
        # The path's cost less what hidden frames and the sink cost: what the visible ones cost.
        constant = self.costs.change + self.costs.occlusion
        visible = len(rest) - hidden
        cost = solution.report.objective - constant * (hidden + 1)
        if visible and cost / visible > self.window.birth_max_cost:
            found[1:] = OCCLUDED
        return found

    def _agree(
        self, frames: Sequence[Detections], first: npt.NDArray[np.int64], second: npt.NDArray[np.int64]
    ) -> bool:
        either, both = 0, 0
        for seen, one, other in zip(frames, first, second, strict=True):
            either += one != OCCLUDED or other != OCCLUDED
            if OCCLUDED not in {one, other}:
                same = one == other or iou(seen.boxes[one], seen.boxes[other]) >= _SAME_PLACE_IOU
                both += bool(same)
        return both >= _MIN_AGREEMENT * either
