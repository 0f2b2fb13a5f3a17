"""Surfaces of a sports hall: the color at each point, as red, green, blue in 0..1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.room.room import Room

_MAPLE = np.array([0.80, 0.60, 0.38])
_APRON = np.array([0.16, 0.34, 0.47])  # around the court
_KEY = np.array([0.64, 0.25, 0.17])  # before the baskets
_PAINT = np.array([0.95, 0.94, 0.90])
_PAD = np.array([0.20, 0.37, 0.53])
_WALL = np.array([0.82, 0.81, 0.77])
_STRIPE = np.array([0.80, 0.36, 0.20])
_SKY = np.array([0.86, 0.92, 0.96])
_CEILING = np.array([0.66, 0.67, 0.68])
_LINE = 0.07  # meters
_PLANK = 0.14  # meters
_MARGIN = 2.0  # meters from the walls to the lines
_BASKET = 1.2  # meters from an end line to the basket
_KEY_SIZE = (4.8, 3.6)  # meters, along and across
_CIRCLE = 1.8  # meters, radius
_ARC = 5.4  # meters from the basket
_PADDED = 2.1  # meters above the floor
_WINDOW = (5.0, 6.5)  # meters above the floor


def light(room: Room, x: Floats, y: Floats) -> Floats:
    """Return the brightness of floor points: rows of lamps, slightly darker towards the walls."""
    near = np.minimum(np.minimum(x, room.width - x), np.minimum(y, room.depth - y))
    rows = 0.025 * np.cos(2 * np.pi * x / 6.0) * np.cos(2 * np.pi * y / 7.25)
    bright: Floats = 0.95 + rows - 0.16 * np.exp(-np.maximum(near, 0) / 1.3)
    return bright


def floor(room: Room, points: Floats) -> Floats:
    """Return the colors of floor points ``(N, 3)``: maple with the lines of a basketball court."""
    x, y = points[:, 0], points[:, 1]
    east, north = room.width - _MARGIN, room.depth - _MARGIN
    inside = (x > _MARGIN) & (x < east) & (y > _MARGIN) & (y < north)
    color = np.where(inside[:, None], _MAPLE * _planks(x, y)[:, None], _APRON)
    # Both halves are equal: coordinates are relative to the nearer end line.
    along, across = np.minimum(x - _MARGIN, east - x), y - room.depth / 2
    length, half = _KEY_SIZE[0], _KEY_SIZE[1] / 2
    key = inside & (along < length) & (np.abs(across) < half)
    middle = np.hypot(x - room.width / 2, across)
    painted = key | (middle < _CIRCLE)
    color = np.where(painted[:, None], _KEY * (0.93 + 0.07 * _planks(x, y))[:, None], color)
    lines = _near(middle - _CIRCLE) | (inside & _near(x - room.width / 2))
    lines |= _frame(x, y, (_MARGIN, _MARGIN, east, north))
    lines |= _frame(along, across, (-1.0, -half, length, half)) & inside
    lines |= _near(np.hypot(along - length, across) - _CIRCLE) & (along > length)
    lines |= _near(np.hypot(along - _BASKET, across) - _ARC) & (along > _BASKET) & inside
    lines |= _near(np.abs(across) - _ARC) & (along <= _BASKET) & inside
    color = np.where(lines[:, None], _PAINT, color)
    return color * (light(room, x, y) * 0.94)[:, None]


def wall(room: Room, points: Floats, axis: int, *, far: bool) -> Floats:
    """Return the colors of points ``(N, 3)`` of a wall; `axis` is 0 for west and east. All are equal."""
    del far
    along, z = points[:, 1 - axis], points[:, 2]
    length = room.depth if axis == 0 else room.width
    seam = np.abs((along / 1.2) % 1.0 - 0.5) > 0.485  # noqa: PLR2004 — pads of 1.2 m
    pad = _PAD * np.where(seam, 0.8, 1.0)[:, None]
    color = np.where((z < _PADDED)[:, None], pad, _WALL)
    color = np.where(((z > _PADDED) & (z < _PADDED + 0.22))[:, None], _STRIPE, color)
    pane = np.abs((along - length / 2) / 2.4 % 1.0 - 0.5)
    high = (z > _WINDOW[0]) & (z < _WINDOW[1])
    color = np.where((high & (pane < 0.44))[:, None], _SKY, color)  # noqa: PLR2004 — the rest is frame
    corner = np.minimum(along, length - along)
    shade = 1 - 0.16 * np.exp(-np.maximum(corner, 0) / 0.7) - 0.22 * np.exp(-np.maximum(z, 0) / 0.35)
    return color * (shade * (0.84 if axis == 0 else 0.90))[:, None]


def ceiling(points: Floats) -> Floats:
    """Return the colors of ceiling points ``(N, 3)``: rows of lamps."""
    lamp = (np.abs(points[:, 0] / 6.0 % 1.0 - 0.5) < 0.03) & (np.abs(points[:, 1] / 3.6 % 1.0 - 0.5) < 0.3)  # noqa: PLR2004 — slim and long
    return np.where(lamp[:, None], np.array([1.0, 1.0, 0.97]), _CEILING)


def _planks(x: Floats, y: Floats) -> Floats:
    """Return the tone ``(N,)`` of planks: about 1."""
    row = np.floor(y / _PLANK)
    shift = np.sin(row * 12.9898) * 43758.5453 % 1.0
    board = np.floor(x / 1.9 + shift)
    tone = np.sin(row * 78.233 + board * 37.719) * 43758.5453 % 1.0
    shades: Floats = 0.95 + 0.08 * tone
    return shades


def _near(distance: Floats) -> NDArray[np.bool_]:
    return np.abs(distance) < _LINE / 2


def _frame(x: Floats, y: Floats, box: tuple[float, float, float, float]) -> NDArray[np.bool_]:
    """Return which points lie on the outline of a box."""
    west, south, east, north = box
    depth = np.minimum(np.minimum(x - west, east - x), np.minimum(y - south, north - y))
    return np.abs(depth) < _LINE / 2
