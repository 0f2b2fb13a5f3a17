"""Online tracking of one camera: the network program in a moving window (paper II.E)."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt

from tracking.appearance import appearance_distance_matrix
from tracking.appearance_histograms import add_appearance_histograms
from tracking.boxes import Floats, iou
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS
from tracking.interpolation import interpolate_gaps
from tracking.lifecycle.gating import gate_detections, restrict_network
from tracking.lifecycle.initiation import Birth, find_births
from tracking.lifecycle.termination import terminated_ids
from tracking.model.network import CostSettings, Network, build_network
from tracking.model.object_state import Sighting, TrackedObject
from tracking.solvers.base import OCCLUDED, Solver, SolveReport, create_solver
from tracking.solvers.warm_start import WindowWarmStart
from tracking.types import Detections
from tracking.window import (
    WindowResult,
    WindowSettings,
    WindowTrack,
    mean_confidence,
    merge_results,
    select_boxes,
)

# Overlap (IoU) above which two boxes contain parts of each other's object.
_MAX_OVERLAP = 0.15


class OnlineTracker:
    """Tracks the objects of one camera. Deterministic; memory bounded by the window and the object list.

    Windows end at frames n where `stride` divides n + 1, so all cameras end theirs at the same frames.
    The window extends from the first frame that is not final to the newest; the templates are the objects in
    the last final frame, which is one frame of overlap.
    """

    def __init__(
        self,
        window: WindowSettings,
        costs: CostSettings,
        solver: Solver,
        fps: float = DEFAULT_FPS,
        center: tuple[float, float] | None = None,
    ) -> None:
        """Create a tracker for `fps` frames per second.

        `center`, pixels: the center of the image, where the layout term places a hidden object (II.D).
        """
        self._center = center
        self._window = window.resolve(fps)
        self._costs = costs.for_fps(fps)
        self._solver = solver
        # For a single object dynamic programming is exact.
        self._single = create_solver("separate-dp")
        self._detections: dict[int, Detections] = {}
        self._objects: list[TrackedObject] = []
        self._next_id = 1
        self._warm_start: WindowWarmStart | None = None
        self._first: int | None = None
        self._last: int | None = None

    def push(
        self,
        frame: int,
        detections: Detections,
        image: Image | None = None,  # noqa: ARG002 — other trackers use it
    ) -> WindowResult | None:
        """Add the detections of a frame; return a result if one or more windows end.

        Skipped frame numbers are frames without detections. After a gap longer than `forget_after` all frames
        before it are final, all objects are dropped, and the frames of the gap are in no result.

        Raises:
            ValueError: the frame number is not larger than the last one.
        """
        if self._last is not None and frame <= self._last:
            raise ValueError(f"frame {frame} came after frame {self._last}")
        results: list[WindowResult] = []
        if self._last is None:
            self._first = frame
        elif frame - self._last > self._window.forget_after:
            return self._restart(frame, detections)
        else:
            results += [
                self._solve(end, end - self._window.min_final_lag)
                for end in self._window_ends(self._last + 1, frame)
            ]
        self._detections[frame] = detections
        self._last = frame
        if (frame + 1) % self._window.stride == 0:
            results.append(self._solve(frame, frame - self._window.min_final_lag))
        return merge_results(results)

    def flush(self) -> WindowResult | None:
        """End the recording: all frames become final. Return `None` if they were final already."""
        return merge_results(self._flush_windows())

    def _restart(self, frame: int, detections: Detections) -> WindowResult | None:
        """Restart after a long gap, with this frame as the first.

        No window ends at this frame, so that no result spans the gap.
        """
        result = self.flush()
        self._objects = []
        self._warm_start = None
        self._detections = {frame: detections}
        self._first = self._last = frame
        return result

    def _flush_windows(self) -> list[WindowResult]:
        if self._first is None or self._last is None or self._last < self._first:
            return []
        return [self._solve(self._last, self._last)]

    def _window_ends(self, start: int, stop: int) -> list[int]:
        """Return the window ends in `start <= n < stop`."""
        stride = self._window.stride
        return list(range(start + (-(start + 1)) % stride, stop, stride))

    def _solve(self, end: int, final_to: int) -> WindowResult:
        """Solve the window that ends at `end` and make the frames up to `final_to` final."""
        first = self._first if self._first is not None else end
        numbers = range(first, end + 1)
        frames = [self._frame(number) for number in numbers]
        states, report = self._assign(first, frames)
        initiated = self._initiate_tracks(first, frames, states)
        if initiated:
            states, report = self._assign(first, frames)
        boxes = [select_boxes(row, frames) for row in states]
        ended = terminated_ids(self._objects, boxes, self._window.duplicate_overlap)
        visible = [
            n
            for n, (item, rows) in enumerate(zip(self._objects, boxes, strict=True))
            if item.id not in ended and not np.isnan(rows).all()
        ]
        tracks = [self._track(self._objects[n], first, states[n], boxes[n], frames) for n in visible]
        final = frames[: max(final_to - first + 1, 0)]
        with_histograms = add_appearance_histograms(tracks, [states[n] for n in visible], first, final)
        alive = [n for n, item in enumerate(self._objects) if item.id not in ended]
        self._objects = [self._objects[n] for n in alive]
        self._finish(first, final_to, frames, states[alive])
        return WindowResult(first, end, max(final_to, first - 1), with_histograms, report)

    def _frame(self, number: int) -> Detections:
        return self._detections[number] if number in self._detections else Detections.empty(self._bins())

    def _bins(self) -> int:
        return next((detections.histograms.shape[1] for detections in self._detections.values()), 0)

    def _assign(self, first: int, frames: Sequence[Detections]) -> tuple[npt.NDArray[np.int64], SolveReport]:
        """Solve the window for all objects; return states `(n, F)`, -1 where occluded."""
        states = np.full((len(self._objects), len(frames)), OCCLUDED, dtype=np.int64)
        allowed = self._gated_detections(first, frames)
        # An object without any gated detection is occluded throughout and need not enter the program.
        inside = np.flatnonzero(allowed.any(axis=(1, 2))).tolist()
        if not inside:
            report = SolveReport(self._solver.name, 0.0, 0.0, integral=True, conflicts=0, rounds=0)
            return states, report
        templates = [self._objects[n].template(first) for n in inside]
        ids = [template.id for template in templates]
        network = restrict_network(
            build_network(templates, frames, self._costs, self._center), allowed[inside]
        )
        network = self._adjust_costs(network, first, ids)
        solution = self._solver.solve(
            network, self._warm_start.for_window(first, ids) if self._warm_start else None
        )
        self._warm_start = WindowWarmStart(first, ids, solution.warm_start)
        states[inside] = solution.states
        return states, solution.report

    def _gated_detections(self, first: int, frames: Sequence[Detections]) -> npt.NDArray[np.bool_]:
        """Return which detections of each frame each object can be, `(n, M, K)`."""
        near = [item.frames_occluded(first - 1) <= self._window.reidentify_after for item in self._objects]
        kept = np.flatnonzero(near)
        among = gate_detections([self._objects[n] for n in kept], first, frames, self._window)
        allowed = np.zeros((len(near), *among.shape[1:]), dtype=np.bool_)
        allowed[kept] = among
        return allowed

    def _adjust_costs(self, network: Network, first: int, ids: list[int]) -> Network:  # noqa: ARG002
        """Return the network to solve for the objects `ids`; subclasses override it to change costs."""
        return network

    def _assign_id(self, birth: Birth, frame: int) -> int:  # noqa: ARG002
        """Return an unused id for an object initiated in this frame."""
        self._next_id += 1
        return self._next_id - 1

    def _initiate_tracks(self, first: int, frames: list[Detections], states: npt.NDArray[np.int64]) -> bool:
        """Start tracks for new objects; return whether there are any."""
        start = max(len(frames) - self._window.birth_window, 0)
        test = frames[start:]
        occupied = [
            detections.boxes[[state for state in states[:, start + m] if state != OCCLUDED]]
            for m, detections in enumerate(test)
        ]
        added = False
        occluded = {
            item.id for item, row in zip(self._objects, states, strict=True) if (row == OCCLUDED).all()
        }
        for birth in find_births(test, occupied, self._window, self._costs, self._single):
            frame = first + start + birth.offset
            if self._reidentify(first, frame, birth):
                added = True
            elif self._evict_if_full(first, occluded):
                self._objects.append(
                    TrackedObject(
                        self._assign_id(birth, frame),
                        birth.histogram,
                        birth.box,
                        frame,
                        self._window.fps,
                    )
                )
                added = True
        return added

    def _reidentify(self, first: int, frame: int, birth: Birth) -> bool:
        """Re-identify a birth as a long occluded object of the same appearance; return whether it matched."""
        occluded_objects = [
            item for item in self._objects if item.frames_occluded(first - 1) > self._window.reidentify_after
        ]
        if not occluded_objects or not birth.histogram.size:
            return False
        histograms = np.stack([item.histogram for item in occluded_objects])
        distances = appearance_distance_matrix(birth.histogram[None], histograms, self._costs.measure)[0]
        best = int(np.argmin(distances))
        if distances[best] > self._window.reidentify_max_distance:
            return False
        occluded_objects[best].restart_at(birth.box, frame)
        return True

    def _evict_if_full(self, frame: int, occluded: Collection[int]) -> bool:
        """Remove the longest occluded object if the list is full; return whether there is room.

        `occluded` contains the ids of the objects occluded throughout this window.
        """
        if len(self._objects) < self._window.max_objects:
            return True
        occluded_objects = [
            item for item in self._objects if item.id in occluded and item.frames_occluded(frame) > 0
        ]
        if occluded_objects:
            # `max` returns the first of equal items: the lowest id.
            self._objects.remove(max(occluded_objects, key=lambda item: item.frames_occluded(frame)))
        return bool(occluded_objects)

    def _track(
        self,
        item: TrackedObject,
        first: int,
        states: npt.NDArray[np.int64],
        boxes: Floats,
        frames: Sequence[Detections],
    ) -> WindowTrack:
        last = (item.frame - first, item.box) if item.frame < first else None
        filled = interpolate_gaps(boxes, last, self._window.max_interpolated_gap)
        return WindowTrack(item.id, boxes, filled, item.histogram, mean_confidence(states, frames))

    def _finish(
        self, first: int, final_to: int, frames: Sequence[Detections], states: npt.NDArray[np.int64]
    ) -> None:
        """Make the frames up to `final_to` final: update the objects, and drop long occluded ones."""
        if final_to < first:
            return
        for m, detections in enumerate(frames[: final_to - first + 1]):
            column = states[:, m]
            assigned = detections.boxes[column[column != OCCLUDED]]
            overlaps = iou(assigned[:, None], assigned[None])
            isolated = iter((np.count_nonzero(overlaps > _MAX_OVERLAP, axis=1) <= 1).tolist())
            for item, state in zip(self._objects, column, strict=True):
                item.present = bool(state != OCCLUDED)
                if item.present:
                    box, histogram = detections.boxes[state], detections.histograms[state]
                    item.update(
                        Sighting(first + m, box, histogram, next(isolated)), self._window.template_update_rate
                    )
        forget_after = self._window.forget_after
        self._objects = [item for item in self._objects if item.frames_occluded(final_to) <= forget_after]
        self._detections = {n: detections for n, detections in self._detections.items() if n > final_to}
        self._first = final_to + 1
