"""Surfaces of a house: the color at each point of floor, walls and corridors, as red, green, blue in 0..1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.room.room import Room

_PLANK_WIDTH = 0.19  # meters
_PLANK_LENGTH = 1.7  # meters
_SKIRTING = 0.11  # meters above the floor
_WAINSCOT = 1.05  # meters above the floor
_WINDOW = (0.95, 2.35)  # sill and lintel, meters above the floor
_WINDOW_WIDTH = 1.5  # meters
_WINDOW_PITCH = 2.4  # meters from one window to the next

_WALL = np.array([0.50, 0.555, 0.59])
_PANEL = np.array([0.38, 0.435, 0.475])
_WHITE = np.array([0.70, 0.70, 0.685])
_SKY = np.array([0.80, 0.87, 0.93])
_CEILING = np.array([0.64, 0.64, 0.63])
_FLOOR = np.array([0.56, 0.485, 0.405])
_RUG = np.array([0.40, 0.46, 0.455])
_CORRIDOR = np.array([0.33, 0.31, 0.29])


def hash_noise(a: Floats, b: Floats) -> Floats:
    """Return a hash in 0..1 of each pair of whole numbers, the same on every machine."""
    mixed = a.astype(np.int64).astype(np.uint32) * np.uint32(374761393)
    mixed += b.astype(np.int64).astype(np.uint32) * np.uint32(668265263)
    mixed = (mixed ^ (mixed >> np.uint32(13))) * np.uint32(1274126177)
    return ((mixed ^ (mixed >> np.uint32(16))) & np.uint32(0xFFFF)) / 65535.0


def light(room: Room, x: Floats, y: Floats) -> Floats:
    """Return the brightness of floor points, about 0.6 to 1.1: windows in the west and south, soft lamps."""
    lamps = np.exp(-((x - room.width * 0.5) ** 2 + (y - room.depth * 0.55) ** 2) / 9.0)
    windows = 0.20 * np.exp(-np.maximum(x, 0) / 2.6) + 0.17 * np.exp(-np.maximum(y, 0) / 2.2)
    beyond = np.maximum(np.maximum(x - room.width, y - room.depth), 0)
    inside = 0.72 + 0.24 * lamps + windows
    shade: Floats = inside * (0.42 + 0.58 * np.exp(-beyond / 0.35))
    return shade


def floor(room: Room, points: Floats) -> Floats:
    """Return the colors of floor points ``(N, 3)``: oak planks, darker towards the walls."""
    x, y = points[:, 0], points[:, 1]
    row = np.floor(y / _PLANK_WIDTH)
    along = x / _PLANK_LENGTH + hash_noise(row, row * 0 + 7)
    tone = 0.94 + 0.12 * hash_noise(row, np.floor(along))
    grain = 0.02 * np.sin(9.0 * x + 5.0 * np.sin(41.0 * y) + 60.0 * tone)
    across = np.abs(y / _PLANK_WIDTH - row - 0.5) * 2
    joint = np.abs(along - np.floor(along) - 0.5) * 2
    seam = 1.0 - 0.22 * np.maximum(_edge(across, 0.93), _edge(joint, 0.992))
    near = np.minimum(np.minimum(x, room.width - x), np.minimum(y, room.depth - y))
    shade = (tone + grain) * seam * (1 - 0.30 * np.exp(-np.maximum(near, 0) / 0.28))
    color = _carpet(room, x, y, _FLOOR * shade[:, None])
    return color * light(room, x, y)[:, None]


def _carpet(room: Room, x: Floats, y: Floats, color: Floats) -> Floats:
    """Return floor colors with the rug: a field within a light line and a border, and a shade around it."""
    west, south, east, north = room.rug
    depth = np.minimum(np.minimum(x - west, east - x), np.minimum(y - south, north - y))
    weave = 0.97 + 0.06 * hash_noise(np.floor(x * 40), np.floor(y * 40))
    line = (depth > 0.16) & (depth < 0.22)  # noqa: PLR2004 — meters from the rug's edge
    cloth = np.where((depth > 0.16)[:, None], _RUG, _RUG * 0.84)  # noqa: PLR2004 — meters from the rug's edge
    cloth = np.where(line[:, None], _RUG * 1.22, cloth)
    around = 1 - 0.22 * np.exp(-np.maximum(-depth, 0) / 0.05)
    return np.where((depth > 0)[:, None], cloth * weave[:, None], color * around[:, None])


def ceiling(points: Floats) -> Floats:
    """Return the colors of ceiling points ``(N, 3)``."""
    return np.broadcast_to(_CEILING, points.shape).copy()


def wall(room: Room, points: Floats, axis: int, *, far: bool) -> Floats:
    """Return the colors of points ``(N, 3)`` of one wall.

    `axis` is 0 for the west and east walls and 1 for the south and north ones; `far` names the east or north.
    """
    along, z = points[:, 1 - axis], points[:, 2]
    length = room.depth if axis == 0 else room.width
    color = np.where((z < _WAINSCOT)[:, None], _PANEL, _WALL)
    color = np.where((np.abs(z - _WAINSCOT) < 0.025)[:, None], _WHITE * 0.9, color)  # noqa: PLR2004 — dado rail
    color = _frames(color, along, z, _HUNG[axis]) if far else _windows(color, along, z, length)
    color = np.where((z < _SKIRTING)[:, None], _WHITE * 0.86, color)
    corner = np.minimum(along, length - along)
    hollow = (
        1 - 0.20 * np.exp(-corner / 0.35) - 0.20 * np.exp(-z / 0.25) - 0.12 * np.exp(-(room.height - z) / 0.5)
    )
    bright = (0.93 if far else 0.80) + 0.10 * np.exp(-(((along - length / 2) / 3.0) ** 2))
    return color * (hollow * bright)[:, None]


def corridor_color(points: Floats, depth: Floats) -> Floats:
    """Return the colors of points seen through a doorway, `depth` ``(N,)`` meters behind the wall."""
    ground = points[:, 2] < 1e-6  # noqa: PLR2004 — on the floor
    color = np.where(ground[:, None], _FLOOR * 0.62, _CORRIDOR * 1.15)
    jamb = depth < 0.16  # noqa: PLR2004 — the wall's thickness, meters
    color = np.where((jamb & ~ground)[:, None], _WHITE * 0.8, color)
    return color * (0.45 + 0.55 * np.exp(-depth / 0.7))[:, None]


def _edge(value: Floats, start: float) -> Floats:
    return np.clip((value - start) / (1 - start), 0, 1)


def _inside(along: Floats, z: Floats, size: tuple[float, float], middle: float) -> NDArray[np.bool_]:
    half, level = size[0] / 2, size[1] / 2
    return (np.abs(along) < half) & (np.abs(z - middle) < level)


def _windows(color: Floats, along: Floats, z: Floats, length: float) -> Floats:
    count = max(int((length - 1.0) / _WINDOW_PITCH), 1)
    start = (length - count * _WINDOW_PITCH) / 2
    local = (along - start) % _WINDOW_PITCH - _WINDOW_PITCH / 2
    local = np.where((along < start) | (along > length - start), FAR_AWAY, local)
    sill, lintel = _WINDOW
    middle, tall = (sill + lintel) / 2 + 0.2, lintel - sill
    color = np.where(_inside(local, z, (_WINDOW_WIDTH + 0.16, tall + 0.16), middle)[:, None], _WHITE, color)
    glow = _SKY * (0.86 + 0.14 * (z - sill) / tall)[:, None]
    glass = _inside(local, z, (_WINDOW_WIDTH, tall), middle) & (np.abs(local) > 0.03)  # noqa: PLR2004 — the mullion
    return np.where(glass[:, None], glow, color)


FAR_AWAY = 1e6

_PICTURES = (
    ((0.30, 0.42, 0.46), (0.68, 0.60, 0.42)),
    ((0.52, 0.36, 0.30), (0.72, 0.66, 0.58)),
    ((0.24, 0.33, 0.30), (0.56, 0.62, 0.52)),
)


_HUNG = ((2.55, 3.85), (3.6, 4.9, 6.2))  # where, along the east and the north wall, meters


def _frames(color: Floats, along: Floats, z: Floats, places: tuple[float, ...]) -> Floats:
    """Return wall colors with framed pictures: a field, a sky and a sun each."""
    for index, ((low, high), place) in enumerate(zip(_PICTURES, places, strict=False)):
        local = along - place
        rim, mat = (0.92, 0.72), (0.84, 0.64)
        color = np.where(_inside(local, z, rim, 1.72)[:, None], np.array([0.14, 0.14, 0.15]), color)
        color = np.where(_inside(local, z, mat, 1.72)[:, None], _WHITE, color)
        hill = z < 1.66 + 0.07 * np.sin(7.0 * local + index * 2.0)
        art = np.where(hill[:, None], np.array(low), np.array(high))
        sun = (local - 0.12) ** 2 + (z - 1.83) ** 2 < 0.005  # noqa: PLR2004 — a disc of 7 cm
        art = np.where(sun[:, None], np.array([0.85, 0.66, 0.42]), art)
        color = np.where(_inside(local, z, (0.68, 0.48), 1.72)[:, None], art, color)
    return color
