"""The frames after a window, as they will be if everybody goes on as they went."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats, overlap
from tracking.interactive.solved_window import Solved
from tracking.interactive.swap_margins import exchanges
from tracking.model.motion import MotionModel
from tracking.model.network import build_network
from tracking.model.object_state import Template
from tracking.model.settings import CostSettings
from tracking.types import Detections

_TOUCH = 0.25
"""Shared over average area from which two boxes are in each other's way."""

_RECENT = 5
"""Frames within which somebody must have been seen, and how often, for their way to be known."""

_SIGHTINGS = 12
"""Sightings that a velocity is taken from, at most."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """Two whose ways cross.

    Attributes:
        first, second: their ids.
        frame: frames after the one that follows the window.
        length: frames for which they are in each other's way, as far as it is looked ahead.
        margin: what it would cost to take each for the other from then on.
    """

    first: int
    second: int
    frame: int
    length: int
    margin: float


def ways(window: Solved, frames: int) -> dict[int, tuple[int, Floats]]:
    """Give where everybody goes who was seen often enough: for how long they are hidden, and `(frames, 4)`.

    The first of these boxes is in the frame after the last sighting.
    """
    found = {}
    for n in range(len(window.known)):
        seen = np.flatnonzero(~np.isnan(window.trail[n, :, 0]))
        if len(seen) >= _RECENT:
            motion = _motion(window.trail[n], int(seen[-1]) + 1)
            found[n] = window.trail.shape[1] - 1 - int(seen[-1]), motion.predict(frames)
    return found


def _motion(trail: Floats, first: int) -> MotionModel:
    """Give how somebody moves who was at `trail` `(T, 4)`, for frames from `first` on."""
    seen = np.flatnonzero(~np.isnan(trail[:, 0]))[-_SIGHTINGS:]
    return MotionModel.of(seen.tolist(), trail[seen], first)


def crossings(window: Solved, horizon: int, costs: CostSettings) -> list[Crossing]:
    """Give those who are apart now and in each other's way within the horizon.

    The margin is that of `exchanges` in a window of `horizon` frames that lies ahead, in which everybody is
    found where they will be, looking as they did: whose looks, speeds or directions differ, or who pass at
    a distance, would cost much to be taken for each other.
    """
    known = {n: it for n, it in ways(window, horizon + _RECENT).items() if it[0] < _RECENT}
    if len(known) < 2:  # noqa: PLR2004 — a pair
        return []
    rows = list(known)
    ahead = np.stack([way[hidden:][:horizon] for hidden, way in known.values()])
    meeting = overlap(ahead[:, None], ahead[None]) > _TOUCH
    near = np.triu(meeting.any(axis=2) & ~meeting[:, :, 0], 1)
    if not near.any():
        return []
    looks = window.looks[rows]
    seen = [Detections(ahead[:, m], np.ones(len(rows)), looks) for m in range(horizon)]
    motions = [_motion(window.trail[n], window.trail.shape[1]) for n in rows]
    templates = [
        Template(n, look, motion.box, motion) for n, look, motion in zip(rows, looks, motions, strict=True)
    ]
    states = np.tile(np.arange(len(rows))[:, None], (1, horizon))
    found = exchanges(build_network(templates, seen, costs), states)
    return [
        Crossing(
            window.known[rows[a]],
            window.known[rows[b]],
            int(meeting[a, b].argmax()),
            int(np.count_nonzero(meeting[a, b])),
            max(float(found.margins[a, b]), 0.0),
        )
        for a, b in zip(*(it.tolist() for it in np.nonzero(near)), strict=True)
        if np.isfinite(found.margins[a, b])
    ]
