"""Tracker of given objects by template matching (the toys of paper IV.A.1)."""

from __future__ import annotations

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image
from tracking.detectors.template import TemplateDetector, TemplateSettings
from tracking.frame_rate import DEFAULT_FPS
from tracking.model.network import build_network_per_object
from tracking.model.object_state import Template
from tracking.model.settings import CostSettings
from tracking.solvers.base import Solver, SolveReport
from tracking.types import Detections
from tracking.window import WindowResult, WindowSettings, WindowTrack, mean_confidence, select_boxes


class TemplateTracker:
    """Tracks n given objects with ids from 1. No objects are added or removed.

    The observations of an object are the correlation peaks of its image in the first frame, which remains its
    template. Windows end at frames n where `stride` divides n + 1, like those of `OnlineTracker`. A `window`
    of 19 and the frame of the templates make the paper's segments of 20 frames.

    Raises:
        ValueError: boxes are not `(n, 4)`, there is none, or one contains too little of the image.
    """

    def __init__(
        self,
        image: Image,
        boxes: Floats,
        settings: TemplateSettings,
        window: WindowSettings,
        costs: CostSettings,
        solver: Solver,
        frame: int = 0,
        fps: float = DEFAULT_FPS,
    ) -> None:
        initial_boxes = np.asarray(boxes, dtype=np.float64)
        if initial_boxes.ndim != 2 or initial_boxes.shape[1] != BOX_SIDES or not len(initial_boxes):  # noqa: PLR2004 — rows, sides
            raise ValueError(f"templates are boxes (n, 4), at least one, not {initial_boxes.shape}")
        self._detectors = [TemplateDetector(_crop(image, box), settings) for box in initial_boxes]
        self._last_boxes: list[Floats | None] = list(initial_boxes)
        self._window, self._costs, self._solver = window.resolve(fps), costs.for_fps(fps), solver
        self._detections: list[list[Detections]] = [[] for _ in initial_boxes]
        self._first = frame + 1
        self._last = frame

    def push(self, image: Image) -> WindowResult | None:
        """Add the next frame; return a result if a window ends.

        Raises:
            ValueError: not an `(H, W, 3)` uint8 image, or smaller than a template.
        """
        for detections, detector in zip(self._detections, self._detectors, strict=True):
            detections.append(detector.detect(image))
        self._last += 1
        if (self._last + 1) % self._window.stride:
            return None
        return self._solve(self._last - self._window.min_final_lag)

    def flush(self) -> WindowResult | None:
        """End the recording: all frames become final. Return `None` if they were final already."""
        return self._solve(self._last) if self._last >= self._first else None

    def _solve(self, final_to: int) -> WindowResult:
        """Solve the window of all frames that are not final, and make those up to `final_to` final."""
        objects = zip(self._detectors, self._last_boxes, strict=True)
        templates = [Template(n, detector.histogram, box) for n, (detector, box) in enumerate(objects, 1)]
        network = build_network_per_object(templates, self._detections, self._costs)
        solution = self._solver.solve(network)
        rows = [
            select_boxes(states, detections)
            for states, detections in zip(solution.states, self._detections, strict=True)
        ]
        tracks = tuple(
            WindowTrack(item.id, boxes, boxes, item.histogram, mean_confidence(states, detections))
            for item, boxes, states, detections in zip(
                templates, rows, solution.states, self._detections, strict=True
            )
            if not np.isnan(boxes).all()
        )
        return self._finish(max(final_to, self._first - 1), rows, tracks, solution.report)

    def _finish(
        self, final_to: int, rows: list[Floats], tracks: tuple[WindowTrack, ...], report: SolveReport
    ) -> WindowResult:
        result = WindowResult(self._first, self._last, final_to, tracks, report)
        final = final_to - self._first + 1
        if final > 0:
            last = [boxes[final - 1] for boxes in rows]
            self._last_boxes = [None if np.isnan(box).any() else box for box in last]
            self._detections = [detections[final:] for detections in self._detections]
            self._first = final_to + 1
        return result


def _crop(image: Image, box: Floats) -> Image:
    left, top, right, bottom = (max(round(float(side)), 0) for side in box)
    return image[top:bottom, left:right].copy()
