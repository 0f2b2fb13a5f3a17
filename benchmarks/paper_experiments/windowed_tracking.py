"""Tracking of a scene's objects window by window, with any solver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.paper_experiments.label_errors import named
from benchmarks.paper_experiments.scene import CENTER, ExperimentScene
from tracking import CostSettings, Detections, OnlineTracker, SolveReport, Template, WindowSettings
from tracking.boxes import BOX_SIDES, Floats
from tracking.frame_rate import DEFAULT_FPS
from tracking.model.network import Network, build_network, build_network_per_object
from tracking.solvers.base import OCCLUDED, Solver


@dataclass(frozen=True, slots=True, eq=False)
class TrackedLabels:
    """The boxes of the labels.

    Attributes:
        boxes: `(n, T, 4)` pixels, NaN: no label.
        reports: of the solver, window by window.
    """

    boxes: Floats
    reports: tuple[SolveReport, ...]


def follow(
    scene: ExperimentScene, costs: CostSettings, window: WindowSettings, solver: Solver
) -> TrackedLabels:
    """Track the objects of a scene; without templates they are detected as in II.E."""
    if scene.templates:
        return _follow_known(scene, costs, window, solver)
    return _follow_found(scene, costs, window, solver)


def _follow_known(
    scene: ExperimentScene, costs: CostSettings, window: WindowSettings, solver: Solver
) -> TrackedLabels:
    """Solve window after window; a window's templates are the first ones at their last places."""
    frames = scene.truth.frames
    boxes = np.full((len(scene.templates), frames, BOX_SIDES), np.nan)
    for k, item in enumerate(scene.templates):
        if item.box is not None:
            boxes[k, 0] = item.box
    templates, reports, first = list(scene.templates), [], 1
    size = window.resolve(DEFAULT_FPS)
    while first < frames:
        stop = min(first + size.window, frames)
        solution = solver.solve(_network(scene, templates, first, stop, costs))
        reports.append(solution.report)
        for k, states in enumerate(solution.states):
            seen = scene.seen[k if len(scene.seen) > 1 else 0]
            for t, state in enumerate(states, first):
                boxes[k, t] = seen[t].boxes[state] if state != OCCLUDED else np.nan
        first = first + size.stride if stop < frames else frames
        last = boxes[:, first - 1]
        templates = [
            replace(item, box=None if np.isnan(box).any() else box)
            for item, box in zip(templates, last, strict=True)
        ]
    return TrackedLabels(boxes, tuple(reports))


def _network(
    scene: ExperimentScene, templates: Sequence[Template], first: int, stop: int, costs: CostSettings
) -> Network:
    parts: list[Sequence[Detections]] = [frames[first:stop] for frames in scene.seen]
    if len(parts) == 1:
        return build_network(templates, parts[0], costs, CENTER)
    return build_network_per_object(templates, parts, costs, CENTER)


def _follow_found(
    scene: ExperimentScene, costs: CostSettings, window: WindowSettings, solver: Solver
) -> TrackedLabels:
    """Track with the online tracker, which initiates tracks itself."""
    tracker = OnlineTracker(window, costs, solver, center=CENTER)
    tracks: dict[int, Floats] = {}
    reports = []
    frames = scene.truth.frames
    pushed = [tracker.push(t, seen) for t, seen in enumerate(scene.seen[0])]
    for result in [*pushed, tracker.flush()]:
        if result is None:
            continue
        reports.append(result.report)
        final = slice(result.first, result.final_to + 1)
        for track in result.tracks:
            boxes = tracks.setdefault(track.id, np.full((frames, BOX_SIDES), np.nan))
            boxes[final] = track.boxes[: result.final_to + 1 - result.first]
    return TrackedLabels(named(scene.truth, tracks), tuple(reports))
