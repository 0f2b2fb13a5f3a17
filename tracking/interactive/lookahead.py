"""Predicted crossings: extrapolation of a window by constant motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tracking.boxes import Floats, dice_overlap
from tracking.interactive.solved_window import SolvedWindow
from tracking.interactive.swap_margins import find_cheapest_swaps
from tracking.model.motion import MotionModel
from tracking.model.network import build_network
from tracking.model.object_state import Template
from tracking.model.settings import CostSettings
from tracking.types import Detections

_MIN_OVERLAP = 0.25
"""Overlap (shared over average area) from which two boxes count as overlapping."""

_RECENT = 5
"""Frames within which an object must have been detected, and least number of detections, to predict its
path."""

_SIGHTINGS = 12
"""Most detections that a velocity is fitted to."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """Two objects predicted to cross.

    Attributes:
        first, second: their ids.
        offset: index of the frame after the window, 0 for the next one.
        length: frames for which they overlap within the horizon.
        margin: cost of swapping the two from then on.
    """

    first: int
    second: int
    offset: int
    length: int
    margin: float


class PredictedPath(NamedTuple):
    """An object's extrapolated path.

    Attributes:
        frames_occluded: frames since its last detection.
        boxes: `(F, 4)` pixels, from the frame after that detection on.
    """

    frames_occluded: int
    boxes: Floats


def predict_paths(window: SolvedWindow, frames: int) -> dict[int, PredictedPath]:
    """Return the paths of `frames` frames, by index in `known_ids`, of objects detected often enough."""
    paths = {}
    for n in range(len(window.known_ids)):
        visible = np.flatnonzero(~np.isnan(window.recent_boxes[n, :, 0]))
        if len(visible) >= _RECENT:
            motion = _motion(window.recent_boxes[n], int(visible[-1]) + 1)
            occluded = window.recent_boxes.shape[1] - 1 - int(visible[-1])
            paths[n] = PredictedPath(occluded, motion.predict(frames))
    return paths


def _motion(trajectory: Floats, first: int) -> MotionModel:
    """Return the motion model of a trajectory `(T, 4)`, for frames from `first` on."""
    visible = np.flatnonzero(~np.isnan(trajectory[:, 0]))[-_SIGHTINGS:]
    return MotionModel.of(visible.tolist(), trajectory[visible], first)


def predict_crossings(window: SolvedWindow, horizon: int, costs: CostSettings) -> list[Crossing]:
    """Return the pairs that do not overlap now but will within the horizon.

    The margin is that of `find_cheapest_swaps` in a predicted window of `horizon` frames, in which each
    object is detected at its predicted position, with its current appearance. Pairs that differ in
    appearance, speed or direction, or that pass at a distance, have large margins.
    """
    paths = {
        n: path
        for n, path in predict_paths(window, horizon + _RECENT).items()
        if path.frames_occluded < _RECENT
    }
    if len(paths) < 2:  # noqa: PLR2004 — a pair
        return []
    rows = list(paths)
    ahead = np.stack([path.boxes[path.frames_occluded :][:horizon] for path in paths.values()])
    overlapping = dice_overlap(ahead[:, None], ahead[None]) > _MIN_OVERLAP
    crossing = np.triu(overlapping.any(axis=2) & ~overlapping[:, :, 0], 1)
    if not crossing.any():
        return []
    histograms = window.known_histograms[rows]
    predicted = [Detections(ahead[:, m], np.ones(len(rows)), histograms) for m in range(horizon)]
    motions = [_motion(window.recent_boxes[n], window.recent_boxes.shape[1]) for n in rows]
    templates = [
        Template(n, histogram, motion.box, motion)
        for n, histogram, motion in zip(rows, histograms, motions, strict=True)
    ]
    states = np.tile(np.arange(len(rows))[:, None], (1, horizon))
    found = find_cheapest_swaps(build_network(templates, predicted, costs), states)
    return [
        Crossing(
            window.known_ids[rows[a]],
            window.known_ids[rows[b]],
            int(overlapping[a, b].argmax()),
            int(np.count_nonzero(overlapping[a, b])),
            max(float(found.margins[a, b]), 0.0),
        )
        for a, b in zip(*(index.tolist() for index in np.nonzero(crossing)), strict=True)
        if np.isfinite(found.margins[a, b])
    ]
