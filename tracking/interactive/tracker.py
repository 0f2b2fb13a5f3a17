"""The online tracker with risk prediction and operator corrections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tracking.boxes import BOX_SIDES
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS
from tracking.interactive.corrections import PositionCorrection, apply_corrections, near_correction
from tracking.interactive.hypothesis_insertion import apply_insertions
from tracking.interactive.late_correction import backdate_correction
from tracking.interactive.risk import RiskPredictor
from tracking.interactive.settings import InteractiveSettings
from tracking.interactive.solved_window import SolvedWindow
from tracking.interactive.window_memory import WindowMemory, WindowSnapshot
from tracking.lifecycle.initiation import Birth
from tracking.model.network import Network
from tracking.model.settings import CostSettings
from tracking.solvers.base import Solver, SolveReport
from tracking.tracker import OnlineTracker
from tracking.types import Detections
from tracking.window import WindowResult, WindowSettings, merge_results

_MIN_DISAGREEMENT_SHARE = 0.25
"""Share of a correction's weight from which windows are solved again."""


class CorrectableTracker(OnlineTracker):
    """An `OnlineTracker` that predicts identity failures and applies an operator's corrections.

    Without a correction its tracks are those of an `OnlineTracker`. Memory is bounded by `memory_s`.
    """

    def __init__(
        self,
        window: WindowSettings,
        costs: CostSettings,
        solver: Solver,
        assist: InteractiveSettings,
        fps: float = DEFAULT_FPS,
        center: tuple[float, float] | None = None,
    ) -> None:
        super().__init__(window, costs, solver, fps, center)
        self._settings = assist.resolve(fps)
        self._risk_predictor = RiskPredictor(self._settings, self._costs)
        self._memory = WindowMemory(self._settings)
        self._corrections: dict[int, dict[int, PositionCorrection]] = {}
        """By frame and object: a later correction replaces an earlier one."""
        self._contradicted_frames: list[int] = []
        """Frames whose corrections contradict the solution."""
        self._total_disagreement_cost = 0.0
        """Cost by which these corrections contradict the solution."""
        self._network: tuple[Sequence[int], Network] | None = None
        self._solved: SolvedWindow | None = None
        self._predicts_risks = True

    def push(self, frame: int, detections: Detections, image: Image | None = None) -> WindowResult | None:
        """Add the detections of a frame; see `OnlineTracker.push`."""
        gap = 1 if self._last is None else frame - self._last
        if 0 < gap <= self._window.forget_after:
            self._memory.add_detections(frame, detections)
        result = super().push(frame, detections, image)
        if gap > self._window.forget_after:
            # The memory does not span such a gap: frames before it can no longer be corrected.
            self._memory = WindowMemory(self._settings)
            self._memory.add_detections(frame, detections)
        oldest = frame - self._settings.memory_frames
        self._corrections = {
            corrected: by_object for corrected, by_object in self._corrections.items() if corrected >= oldest
        }
        return result

    def remembers(self, frame: int) -> bool:
        """Return whether a correction of this frame can still be applied."""
        if self._last is None or frame > self._last:
            return self._last is not None and frame <= self._last + self._settings.memory_frames
        steps = self._memory.snapshots
        first = steps[0].first if steps else self._first
        return first is not None and frame >= max(first, self._last - self._settings.memory_frames)

    def apply_corrections(self, corrections: Sequence[PositionCorrection]) -> WindowResult | None:
        """Apply an operator's corrections, also to final frames; return the changed result.

        The windows since the first corrected frame are solved again with the corrections' costs
        (`corrections.apply_corrections`), and so is every later window that contains a corrected frame.
        If the operator pointed at the position of another track, the identities were swapped earlier; the
        windows are then solved again from that frame on (`backdate_correction`). The result spans all of
        these windows and replaces the results published for their frames. Tracks keep their ids.

        Returns `None` if nothing changes: the tracks already agree with the corrections, the windows have not
        been solved yet, or the frames are no longer in memory (see `remembers`).
        """
        frames: list[int] = []
        for correction in sorted(corrections, key=lambda it: (it.frame, it.object)):
            if self.remembers(correction.frame):
                frames += self._store_correction(correction)
        # Small contradictions are accumulated; frames that have left the memory are dropped.
        self._contradicted_frames = [
            frame for frame in (*self._contradicted_frames, *frames) if self.remembers(frame)
        ]
        if (
            not self._contradicted_frames
            or self._total_disagreement_cost < _MIN_DISAGREEMENT_SHARE * self._settings.correction_weight
        ):
            return None
        frame = min(self._contradicted_frames)
        self._contradicted_frames, self._total_disagreement_cost = [], 0.0
        return self._solve_again(frame)

    def _store_correction(self, correction: PositionCorrection) -> list[int]:
        """Store a correction; return the frames in which it contradicts the solution."""
        self._corrections.setdefault(correction.frame, {})[correction.object] = correction
        self._ensure_hypothesis(correction)
        disagreement_cost = self._memory.disagreement_cost(correction, self._settings)
        if not disagreement_cost:
            return []
        self._total_disagreement_cost += disagreement_cost
        frames = [correction.frame]
        steps = self._memory.windows_since(correction.frame)
        for implied in backdate_correction(
            correction, self._memory, self._costs, self._last_agreement(correction)
        ):
            if implied.frame < steps[0].first or len(frames) > 1:
                self._corrections.setdefault(implied.frame, {}).setdefault(implied.object, implied)
                frames.append(implied.frame)
        if len(frames) > 1:
            self._total_disagreement_cost += self._settings.correction_weight
        return frames

    def _ensure_hypothesis(self, correction: PositionCorrection) -> None:
        """Insert a hypothesis at the corrected point if no detection fits."""
        histogram = next((item.histogram for item in self._objects if item.id == correction.object), None)
        if histogram is None or correction.frame not in self._memory.detections:
            return
        self._memory.ensure_hypothesis(correction, histogram)
        if correction.frame in self._detections:
            self._detections[correction.frame] = self._memory.detections[correction.frame]

    def _last_agreement(self, correction: PositionCorrection) -> int:
        """Return the frame after the object's last correction that the solution agrees with."""
        before = [
            frame + 1
            for frame, by_object in self._corrections.items()
            if frame < correction.frame
            and correction.object in by_object
            and not self._memory.disagreement_cost(by_object[correction.object], self._settings)
        ]
        return max(before, default=self._memory.snapshots[0].first)

    def _solve_again(self, frame: int) -> WindowResult | None:
        """Solve the windows since a frame again."""
        steps = list(self._memory.windows_since(frame))
        if not steps:
            return None
        before = dict(self._memory.assignments)
        final_before = steps[-1].final_to
        self._objects = [item.copy() for item in steps[0].objects]
        self._warm_start, self._first = steps[0].warm_start, steps[0].first
        results = []
        for step in steps:
            first = self._first
            self._detections = {
                n: detections for n, detections in self._memory.detections.items() if first <= n <= step.end
            }
            # Risks of earlier windows were published already.
            self._predicts_risks = step is steps[-1]
            results.append(self._solve(step.end, step.final_to))
        first = self._first
        self._detections = {n: detections for n, detections in self._memory.detections.items() if n >= first}
        result = merge_results(results)
        changed = [n for n, assigned in sorted(self._memory.assignments.items()) if assigned != before.get(n)]
        if result is None or not changed:
            return None
        return replace(result, revised_from=changed[0] if changed[0] <= final_before else None)

    def _solve(self, end: int, final_to: int) -> WindowResult:
        first = self._first if self._first is not None else end
        objects = tuple(item.copy() for item in self._objects)
        self._memory.record_window(WindowSnapshot(first, end, final_to, objects, self._warm_start))
        result = super()._solve(end, final_to)
        self._memory.keep_only(first, {track.id for track in result.tracks})
        if self._solved is None or not self._predicts_risks:
            return result
        solved = replace(
            self._solved,
            final_to=final_to,
            recent_boxes=self._memory.boxes_of(
                self._solved.known_ids, end, max(self._settings.recent_frames, end - first + 1)
            ),
        )
        return replace(result, risk_events=self._risk_predictor.predict(solved))

    def _assign(self, first: int, frames: Sequence[Detections]) -> tuple[npt.NDArray[np.int64], SolveReport]:
        self._network = None
        states, report = super()._assign(first, frames)
        ids = [item.id for item in self._objects]
        self._memory.record_states(first, ids, states)
        self._solved = None
        if self._network is not None:
            inside, network = self._network
            rows = [ids.index(number) for number in inside]
            self._solved = SolvedWindow(
                first,
                tuple(inside),
                network,
                states[rows],
                frames,
                report,
                final_to=first - 1,
                known_ids=tuple(ids),
                recent_boxes=np.empty((len(ids), 0, BOX_SIDES)),
                known_histograms=np.stack([item.histogram for item in self._objects]),
            )
        return states, report

    def _gated_detections(self, first: int, frames: Sequence[Detections]) -> npt.NDArray[np.bool_]:
        allowed = super()._gated_detections(first, frames)
        for n, item in enumerate(self._objects):
            for m, detections in enumerate(frames):
                correction = self._corrections.get(first + m, {}).get(item.id)
                if correction is not None:
                    # The gate does not apply to the corrected point.
                    allowed[n, m, : len(detections)] |= near_correction(correction, detections.boxes)
                for number, index in self._memory.inserted.get(first + m, {}).items():
                    if number != item.id:
                        allowed[n, m, index] = False
        return allowed

    def _adjust_costs(self, network: Network, first: int, ids: list[int]) -> Network:
        network = apply_insertions(network, first, ids, self._memory.inserted, self._costs.change)
        reappearance_cost = self._costs.change + self._costs.motion + self._costs.reappearance
        network = apply_corrections(network, first, ids, self._corrections, self._settings, reappearance_cost)
        self._network = ids, network
        return network

    def _assign_id(self, birth: Birth, frame: int) -> int:
        number = self._memory.assign_id(frame, birth.box, self._next_id)
        self._next_id = max(self._next_id, number + 1)
        return number
