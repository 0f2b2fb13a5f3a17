"""Fish: a mesh of skin rings around a bending spine, with fins, and its drawing in murky water.

Measures of the mesh are shares of a fish's length.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera
from synthetic.drawing.figure import Figure
from synthetic.tank.shoal import ShoalState
from synthetic.tank.water import TILE, Bytes, attenuate_by_water, caustic_pixels, open_water

LENGTH = 0.8  # meters, all of them, without the tail fin
_AROUND = 16  # corners of a ring
# Along the body: position, half height, half width, height of the center above the axis.
_RINGS = np.array(
    [
        (0.000, 0.012, 0.012, -0.010),
        (0.035, 0.052, 0.038, -0.008),
        (0.090, 0.092, 0.060, -0.002),
        (0.160, 0.126, 0.076, 0.004),
        (0.225, 0.147, 0.084, 0.008),
        (0.285, 0.158, 0.087, 0.010),
        (0.370, 0.164, 0.086, 0.010),
        (0.460, 0.158, 0.080, 0.008),
        (0.540, 0.145, 0.072, 0.006),
        (0.600, 0.131, 0.065, 0.004),
        (0.700, 0.103, 0.050, 0.002),
        (0.800, 0.073, 0.034, 0.000),
        (0.890, 0.050, 0.022, 0.000),
        (0.950, 0.043, 0.015, 0.000),
        (1.000, 0.046, 0.010, 0.000),
    ]
)
_BACK, _SIDE, _BELLY = (
    np.array([0.86, 0.30, 0.07]),
    np.array([0.98, 0.47, 0.12]),
    np.array([1.00, 0.78, 0.50]),
)
_BAND, _EDGE = np.array([0.97, 0.95, 0.90]), np.array([0.16, 0.10, 0.09])
_PALE = ((3, 4), (8, 8))  # first and last rings of the white bands
_FIN, _FIN_DARK = np.array([0.95, 0.44, 0.10]), np.array([0.72, 0.25, 0.06])
# Fins: corners as (along, left, up); the last two are the pectorals, which row.
_FINS = (
    ((0.965, 0, 0.040), (1.075, 0, 0.095), (1.225, 0, 0.165), (1.165, 0, 0.005)),
    ((0.965, 0, -0.040), (1.165, 0, -0.005), (1.225, 0, -0.155), (1.075, 0, -0.090)),
    ((0.255, 0, 0.155), (0.330, 0, 0.245), (0.500, 0, 0.225), (0.520, 0, 0.140)),
    ((0.540, 0, 0.135), (0.610, 0, 0.210), (0.745, 0, 0.165), (0.735, 0, 0.080)),
    ((0.565, 0, -0.125), (0.640, 0, -0.215), (0.760, 0, -0.160), (0.740, 0, -0.080)),
    ((0.350, 0, -0.145), (0.400, 0, -0.240), (0.480, 0, -0.215), (0.465, 0, -0.145)),
    ((0.285, 0.080, -0.035), (0.375, 0.185, -0.020), (0.440, 0.175, -0.115), (0.330, 0.082, -0.095)),
    ((0.285, -0.080, -0.035), (0.375, -0.185, -0.020), (0.440, -0.175, -0.115), (0.330, -0.082, -0.095)),
)
_FIN_DARKS = (0.15, 0.35, 0.3, 0.3, 0.5, 0.5, 0.1, 0.1)  # share of the dark color in each
_EYE = (0.098, 0.060, 0.030)  # along, to either side, up
_EYE_RADII = (0.030, 0.018)  # of the white and of the black
_LIFTS = np.array([0.010, 0.022])  # height of the eye above the skin


def _skin() -> tuple[NDArray[np.intp], Floats]:
    """Return the corners ``(S, 4)`` and the colors ``(S, 3)`` of the skin's faces."""
    corners, colors = [], []
    for ring in range(len(_RINGS) - 1):
        for step in range(_AROUND):
            after = (step + 1) % _AROUND
            here, there = ring * _AROUND, (ring + 1) * _AROUND
            corners.append((here + step, there + step, there + after, here + after))
            rise = np.sin(2 * np.pi * (step + 0.5) / _AROUND)
            blend = np.clip(rise, 0, 1) ** 0.8, np.clip(-rise, 0, 1) ** 0.8
            color = _SIDE + (_BACK - _SIDE) * blend[0] + (_BELLY - _SIDE) * blend[1]
            for first, last in _PALE:
                if first <= ring <= last:
                    color = _BAND * (1 - 0.12 * blend[0])
                elif ring in (first - 1, last + 1):
                    color = color * 0.45 + _EDGE * 0.55
            colors.append(color)
    return np.array(corners, dtype=np.intp), np.array(colors)


_CORNERS, _COLORS = _skin()
_FIRST_FIN = len(_RINGS) * _AROUND
_FIRST_EYE = _FIRST_FIN + 4 * len(_FINS)
FACES = np.concatenate([_CORNERS, _FIRST_FIN + np.arange(4 * (len(_FINS) + 4)).reshape(-1, 4)])
"""The corners ``(F, 4)`` of all faces, by number."""
COLORS = np.concatenate(
    [
        _COLORS,
        [_FIN + (_FIN_DARK - _FIN) * dark for dark in _FIN_DARKS],
        [(0.96, 0.93, 0.86), (0.03, 0.03, 0.04)] * 2,
    ]
)
"""The colors ``(F, 3)`` of all faces: red, green, blue in 0..1."""
THIN = np.zeros(len(FACES), dtype=np.bool_)
"""Which faces ``(F,)`` are visible from both sides: fins."""
THIN[len(_CORNERS) : len(_CORNERS) + len(_FINS)] = True
NEARER = np.zeros(len(FACES))
"""Meters ``(F,)`` nearer in the drawing order: an eye lies on skin."""
NEARER[len(_CORNERS) + len(_FINS) :] = (0.03, 0.035) * 2


@lru_cache(maxsize=1)
def _rest() -> Floats:
    """Return the vertices ``(V, 3)`` of a fish at rest: along from the nose, left, up."""
    turn = 2 * np.pi * np.arange(_AROUND) / _AROUND
    rings = [
        np.column_stack([np.full(_AROUND, along), wide * np.cos(turn), middle + high * np.sin(turn)])
        for along, high, wide, middle in _RINGS
    ]
    fins = np.array(_FINS).reshape(-1, 3)
    return np.concatenate([*rings, fins, _eyes()])


def _eyes() -> Floats:
    along, offsets, up = _EYE
    vertices = []
    for side in (1.0, -1.0):
        for radius, lift in zip(_EYE_RADII, _LIFTS, strict=True):
            square = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)][:: -int(side)]) * radius
            vertices += [(along + x, side * (offsets + lift - 0.35 * x), up + z) for x, z in square.tolist()]
    return np.array(vertices)


def fish_vertices(swimmers: ShoalState) -> Floats:
    """Return all fish's vertices ``(P, V, 3)`` in meters, with bends and tail beats."""
    rest = _rest()
    along = rest[:, 0]
    beat = 2 * np.pi * (swimmers.beats[:, None] - 0.85 * along)
    swing = swimmers.vigour[:, None] * (0.012 + 0.085 * along**2) * np.sin(beat)
    swing -= swimmers.vigour[:, None] * 0.012 * np.sin(beat[:, :1])  # the nose moves nearly straight
    bend = 0.10 * swimmers.turn_rates[:, None] * np.maximum(along - 0.3, 0) ** 2
    local = np.repeat(rest[None], len(swimmers.places), axis=0)
    local[:, :, 1] += swing + bend
    _move_pectorals(local, swimmers.beats)
    local[:, :, 0] = 0.5 - local[:, :, 0]  # from the middle, ahead
    ahead = swimmers.ahead
    left = np.stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(ahead))], axis=1)
    left /= np.maximum(np.linalg.norm(left, axis=1, keepdims=True), 1e-9)
    axes = np.stack([ahead, left, np.cross(ahead, left)], axis=1)
    vertices: Floats = swimmers.places[:, None] + LENGTH * local @ axes
    return vertices


def _move_pectorals(local: Floats, beats: Floats) -> None:
    """Move the pectoral fins, in place."""
    stroke = 0.035 * np.sin(2 * np.pi * beats * 0.5)[:, None]
    for fin in (len(_FINS) - 2, len(_FINS) - 1):
        tips = _FIRST_FIN + 4 * fin + np.array([1, 2])
        local[:, tips, 2] += stroke


_FINE = 3  # drawn pixels per pixel
_SHIFT = 4  # fractional bits of cv2's coordinates
_AMBIENT, _SUN, _NET = 0.72, 0.36, 1.1  # ambient light, sunlight from above, and caustics


def draw_fish(view: PinholeCamera, vertices: Floats, caustic_map: Bytes) -> list[Figure | None]:
    """Draw fish by their vertices ``(P, V, 3)`` in meters, under caustics ``(TILE, TILE)``.

    Patches extend beyond the image's edge if fish do. None for a fish that is not in front of the camera.
    """
    if not len(vertices):
        return []
    pixels, depth = view.project(vertices.reshape(-1, 3))
    pixels, depth = pixels.reshape(*vertices.shape[:2], 2), depth.reshape(vertices.shape[:2])
    inks = _inks(view, vertices, caustic_map)
    return [_draw(*fish) for fish in zip(pixels, depth, inks, strict=True)]


def _inks(view: PinholeCamera, vertices: Floats, caustic_map: Bytes) -> Floats:
    """Compute the colors ``(P, F, 4)`` of all faces: blue, green, red and alpha."""
    facing = vertices[:, FACES]  # (P, F, 4, 3)
    normal = np.cross(facing[:, :, 2] - facing[:, :, 0], facing[:, :, 3] - facing[:, :, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-12)
    rise = np.where(THIN, np.abs(normal[..., 2]) * 0.3 + 0.3, normal[..., 2])
    middle = facing.mean(axis=2)
    spot = caustic_pixels(middle).astype(np.int64) % TILE
    bright = caustic_map[spot[..., 1], spot[..., 0]] / 255.0
    light = _AMBIENT + _SUN * np.clip(rise, -0.6, 1) + _NET * bright * np.clip(rise + 0.15, 0, 1)
    sight = middle.mean(axis=1) - view.center
    distance = np.linalg.norm(sight, axis=1)
    water = open_water(sight / distance[:, None])
    seen = attenuate_by_water(COLORS * light[..., None], distance[:, None], water[:, None])
    inks = np.full((*light.shape, 4), 255.0)
    inks[..., :3] = np.clip(seen[..., ::-1] * 255, 0, 255)
    return inks


def _draw(pixels: Floats, depth: Floats, inks: Floats) -> Figure | None:
    if depth.min() < 0.3:  # noqa: PLR2004 — meters
        return None
    left, top = (np.floor(pixels.min(axis=0)).astype(int) - 1).tolist()
    right, bottom = (np.ceil(pixels.max(axis=0)).astype(int) + 1).tolist()
    width, height = right - left, bottom - top
    outline = pixels[FACES]  # (F, 4, 2)
    first, second = outline[:, 2] - outline[:, 0], outline[:, 3] - outline[:, 1]
    # In the image, where y runs down, a face seen from outside is oriented the other way.
    turns = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    visible = np.flatnonzero(THIN | (turns < 0))
    order = visible[np.argsort(NEARER[visible] - depth[FACES[visible]].mean(axis=1), kind="stable")]
    fixed = _fixed((outline[order] - (left, top)) * _FINE - 0.5)
    canvas = np.zeros((height * _FINE, width * _FINE, 4), dtype=np.uint8)
    for face, ink in zip(fixed, inks[order].tolist(), strict=True):
        cv2.fillConvexPoly(canvas, face, ink, cv2.LINE_8, _SHIFT)
    patch = cv2.resize(canvas, (width, height), interpolation=cv2.INTER_AREA)
    return Figure(left, top, np.asarray(patch, dtype=np.uint8))


def _fixed(points: Floats) -> NDArray[np.int32]:
    return np.rint(points * (1 << _SHIFT)).astype(np.int32)
