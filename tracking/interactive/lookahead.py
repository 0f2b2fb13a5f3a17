"""Predicted crossings: the frames after a window under constant motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats, overlap
from tracking.interactive.solved_window import SolvedWindow
from tracking.interactive.swap_margins import swap_margins
from tracking.model.motion import MotionModel
from tracking.model.network import build_network
from tracking.model.object_state import Template
from tracking.model.settings import CostSettings
from tracking.types import Detections

_MIN_OVERLAP = 0.25
"""Shared over average area from which two boxes overlap."""

_RECENT = 5
"""Frames within which an object must have been seen, and how often, to predict its path."""

_SIGHTINGS = 12
"""Sightings that a velocity is fitted to, at most."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """Two objects predicted to cross.

    Attributes:
        first, second: their ids.
        frame: frames after the one that follows the window.
        length: frames for which they overlap within the horizon.
        margin: cost of swapping the two from then on.
    """

    first: int
    second: int
    frame: int
    length: int
    margin: float


def predict_paths(window: SolvedWindow, frames: int) -> dict[int, tuple[int, Floats]]:
    """Return by object the frames it has been hidden and its predicted boxes `(frames, 4)`.

    The first of these boxes is in the frame after the last sighting.
    """
    found = {}
    for n in range(len(window.known_ids)):
        seen = np.flatnonzero(~np.isnan(window.recent_boxes[n, :, 0]))
        if len(seen) >= _RECENT:
            motion = _motion(window.recent_boxes[n], int(seen[-1]) + 1)
            found[n] = window.recent_boxes.shape[1] - 1 - int(seen[-1]), motion.predict(frames)
    return found


def _motion(trail: Floats, first: int) -> MotionModel:
    """Return the motion model of a trajectory `(T, 4)`, for frames from `first` on."""
    seen = np.flatnonzero(~np.isnan(trail[:, 0]))[-_SIGHTINGS:]
    return MotionModel.of(seen.tolist(), trail[seen], first)


def predict_crossings(window: SolvedWindow, horizon: int, costs: CostSettings) -> list[Crossing]:
    """Return the pairs that are apart now and overlap within the horizon.

    The margin is that of `swap_margins` in a predicted window of `horizon` frames, in which each object is
    detected where it is expected, with its present appearance. Pairs that differ in appearance, speed or
    direction, or that pass at a distance, have large margins.
    """
    known = {n: it for n, it in predict_paths(window, horizon + _RECENT).items() if it[0] < _RECENT}
    if len(known) < 2:  # noqa: PLR2004 — a pair
        return []
    rows = list(known)
    ahead = np.stack([way[hidden:][:horizon] for hidden, way in known.values()])
    meeting = overlap(ahead[:, None], ahead[None]) > _MIN_OVERLAP
    near = np.triu(meeting.any(axis=2) & ~meeting[:, :, 0], 1)
    if not near.any():
        return []
    histograms = window.known_histograms[rows]
    seen = [Detections(ahead[:, m], np.ones(len(rows)), histograms) for m in range(horizon)]
    motions = [_motion(window.recent_boxes[n], window.recent_boxes.shape[1]) for n in rows]
    templates = [
        Template(n, histogram, motion.box, motion)
        for n, histogram, motion in zip(rows, histograms, motions, strict=True)
    ]
    states = np.tile(np.arange(len(rows))[:, None], (1, horizon))
    found = swap_margins(build_network(templates, seen, costs), states)
    return [
        Crossing(
            window.known_ids[rows[a]],
            window.known_ids[rows[b]],
            int(meeting[a, b].argmax()),
            int(np.count_nonzero(meeting[a, b])),
            max(float(found.margins[a, b]), 0.0),
        )
        for a, b in zip(*(it.tolist() for it in np.nonzero(near)), strict=True)
        if np.isfinite(found.margins[a, b])
    ]
