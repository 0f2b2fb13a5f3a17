"""Stepping aside: what people do who would otherwise walk into each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.room.room import Room

KEEP = 0.8  # metres: nearer than this is a bump
_RAMP = 1.5  # seconds to step aside, and to come back
_WALL = 0.45  # metres kept from walls
_FURNITURE = 0.25  # metres kept from furniture


def bumps(mine: Floats, others: Floats, keep: float = KEEP) -> float:
    """Rate how much a way ``(T, 2)`` comes nearer than `keep` to the others ``(O, T, 2)``; 0 is never."""
    apart = np.hypot(*(others - mine).transpose(2, 0, 1))
    return float((np.maximum(keep - apart, 0) ** 2).sum())


def sidestep(room: Room, mine: Floats, others: Floats, rate: float) -> Floats:
    """Move a way ``(T, 2)``, sampled `rate` times a second, aside where it meets the others ``(O, T, 2)``.

    At every encounter the way is moved in one direction, from the other at their closest, and back again:
    as far as walls and furniture allow, so not at all in a doorway.
    """
    way = mine.copy()
    for other in others:
        apart = np.hypot(*(mine - other).T)
        near = np.flatnonzero(apart < KEEP)
        for run in np.split(near, np.flatnonzero(np.diff(near) > 1) + 1):
            if len(run):
                closest = run[apart[run].argmin()]
                way = _aside(room, way, way[closest] - other[closest], run, rate)
    return way


def _aside(room: Room, way: Floats, away: Floats, run: NDArray[np.intp], rate: float) -> Floats:
    gap = float(np.hypot(away[0], away[1]))
    direction = away / gap if gap > 1e-6 else np.array([1.0, 0.0])  # noqa: PLR2004 — exactly on each other
    clock = np.arange(len(way))
    rise = np.clip((clock - run[0]) / (_RAMP * rate) + 1, 0, 1)
    fall = np.clip((run[-1] - clock) / (_RAMP * rate) + 1, 0, 1)
    share = np.minimum(rise, fall)
    moving = share > 0
    step = (share * share * (3 - 2 * share))[:, None] * direction * max(KEEP - gap, 0.0)
    for part in (1.0, 0.66, 0.33):
        moved: Floats = way + part * step
        if _free(room, moved[moving]):
            return moved
    return way


def _free(room: Room, way: Floats) -> bool:
    """Say whether a way ``(T, 2)`` keeps off the walls and the furniture."""
    inner = np.minimum(way, np.array([room.width, room.depth]) - way).min()
    west, south, east, north = room.footprints().T[:, :, None]
    dx = np.maximum(np.maximum(west - way[:, 0], way[:, 0] - east), 0)
    dy = np.maximum(np.maximum(south - way[:, 1], way[:, 1] - north), 0)
    return bool(inner > _WALL) and bool((dx * dx + dy * dy).min() > _FURNITURE**2)
