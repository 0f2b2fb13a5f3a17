"""Collision avoidance: paths planned together are pushed apart; a single path steps aside."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.room.room import Room

_ROUNDS = 60
_SMOOTH = 0.45  # seconds over which a path is bent
_SIDE = np.radians(50.0)  # both swerve to the same side, to pass each other
_FIRM = 0.7  # share of the missing distance that each round corrects
_EASE = 0.6  # seconds at either end over which bending fades
MIN_DISTANCE = 0.8  # meters between two people
_RAMP = 1.5  # seconds to step aside, and to come back
_WALL = 0.45  # meters kept from walls
_FURNITURE = 0.25  # meters kept from furniture


def push_paths_apart(paths: Floats, distances: Floats, rate: float) -> Floats:
    """Bend paths ``(P, T, 2 or 3)``, sampled `rate` times per second, to distances ``(P, P)`` in meters.

    The ends are fixed. In a crowded area some pairs come nearer.
    """
    people, count, axes = paths.shape
    if people < 2:  # noqa: PLR2004 — no pair
        return paths
    clock = np.arange(count)
    ease = np.clip(np.minimum(clock, count - 1 - clock) / (_EASE * rate), 0, 1)[None, :, None]
    turn = np.eye(axes)
    turn[:2, :2] = [[np.cos(_SIDE), np.sin(_SIDE)], [-np.sin(_SIDE), np.cos(_SIDE)]]
    kernel = 2 * int(3 * _SMOOTH * rate) + 1
    bent = paths.copy()
    for _ in range(_ROUNDS):
        gaps = bent[:, None] - bent[None]
        far = np.linalg.norm(gaps, axis=3)
        short = np.maximum(distances[..., None] - far, 0)
        short[np.arange(people), np.arange(people)] = 0
        if not short.any():
            break
        away = gaps / np.maximum(far, 1e-6)[..., None]
        push = (away @ turn * (short / 2)[..., None]).sum(axis=1)
        flat = np.ascontiguousarray(push.transpose(0, 2, 1).reshape(axes * people, count))
        soft = cv2.GaussianBlur(flat, (kernel, 1), _SMOOTH * rate, borderType=cv2.BORDER_REPLICATE)
        # Smoothing flattens a short push: scale it back to its height.
        peak = np.abs(flat).max(axis=1, keepdims=True) / np.maximum(
            np.abs(soft).max(axis=1, keepdims=True), 1e-9
        )
        bent += _FIRM * ease * (soft * peak).reshape(people, axes, count).transpose(0, 2, 1)
    return bent


def proximity_cost(path: Floats, others: Floats, distance: float = MIN_DISTANCE) -> float:
    """Return the cost of a path ``(T, 2)`` for being nearer than `distance` to others ``(O, T, 2)``."""
    apart = np.hypot(*(others - path).transpose(2, 0, 1))
    return float((np.maximum(distance - apart, 0) ** 2).sum())


def sidestep(room: Room, path: Floats, others: Floats, rate: float) -> Floats:
    """Move a path ``(T, 2)``, sampled `rate` times per second, aside where it meets others ``(O, T, 2)``.

    At each encounter the path moves away from the other one at their closest point, and back, as far as walls
    and furniture permit: not at all in a doorway.
    """
    moved = path.copy()
    for other in others:
        apart = np.hypot(*(path - other).T)
        near = np.flatnonzero(apart < MIN_DISTANCE)
        for run in np.split(near, np.flatnonzero(np.diff(near) > 1) + 1):
            if len(run):
                closest = run[apart[run].argmin()]
                moved = _aside(room, moved, moved[closest] - other[closest], run, rate)
    return moved


def _aside(room: Room, path: Floats, away: Floats, run: NDArray[np.intp], rate: float) -> Floats:
    gap = float(np.hypot(away[0], away[1]))
    direction = away / gap if gap > 1e-6 else np.array([1.0, 0.0])  # noqa: PLR2004 — exactly on each other
    clock = np.arange(len(path))
    rise = np.clip((clock - run[0]) / (_RAMP * rate) + 1, 0, 1)
    fall = np.clip((run[-1] - clock) / (_RAMP * rate) + 1, 0, 1)
    share = np.minimum(rise, fall)
    moving = share > 0
    step = (share * share * (3 - 2 * share))[:, None] * direction * max(MIN_DISTANCE - gap, 0.0)
    for part in (1.0, 0.66, 0.33):
        moved: Floats = path + part * step
        if _free(room, moved[moving]):
            return moved
    return path


def _free(room: Room, path: Floats) -> bool:
    """Return whether a path ``(T, 2)`` keeps its distance from walls and furniture."""
    inner = np.minimum(path, np.array([room.width, room.depth]) - path).min()
    west, south, east, north = room.footprints().T[:, :, None]
    dx = np.maximum(np.maximum(west - path[:, 0], path[:, 0] - east), 0)
    dy = np.maximum(np.maximum(south - path[:, 1], path[:, 1] - north), 0)
    return bool(inner > _WALL) and bool((dx * dx + dy * dy).min() > _FURNITURE**2)
