"""Drawing of fish: faces of skin and fins, furthest first, lit, and seen through murky water."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera
from synthetic.drawing.figure import Figure
from synthetic.tank.fish_mesh import COLORS, FACES, NEARER, THIN
from synthetic.tank.water import TILE, Bytes, attenuate_by_water, caustic_pixels, open_water

_FINE = 3  # drawn pixels per pixel
_SHIFT = 4  # fractional bits of cv2's coordinates
_AMBIENT, _SUN, _NET = 0.72, 0.36, 1.1  # light from all around, from above, and where the net of light falls


def draw_fish(view: PinholeCamera, corners: Floats, net: Bytes) -> list[Figure | None]:
    """Draw fish by their corners ``(P, V, 3)`` in meters, under a net of light ``(TILE, TILE)``.

    Patches reach beyond the picture's edge where fish do. None where a fish is not before the camera.
    """
    if not len(corners):
        return []
    pixels, depth = view.project(corners.reshape(-1, 3))
    pixels, depth = pixels.reshape(*corners.shape[:2], 2), depth.reshape(corners.shape[:2])
    inks = _inks(view, corners, net)
    return [_draw(*fish) for fish in zip(pixels, depth, inks, strict=True)]


def _inks(view: PinholeCamera, corners: Floats, net: Bytes) -> Floats:
    """Compute the colors ``(P, F, 4)`` of all faces: blue, green, red and alpha."""
    facing = corners[:, FACES]  # (P, F, 4, 3)
    normal = np.cross(facing[:, :, 2] - facing[:, :, 0], facing[:, :, 3] - facing[:, :, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-12)
    rise = np.where(THIN, np.abs(normal[..., 2]) * 0.3 + 0.3, normal[..., 2])
    middle = facing.mean(axis=2)
    spot = caustic_pixels(middle).astype(np.int64) % TILE
    bright = net[spot[..., 1], spot[..., 0]] / 255.0
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
    # In the picture, where y runs down, a face that is seen from outside turns the other way.
    turns = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    shown = np.flatnonzero(THIN | (turns < 0))
    order = shown[np.argsort(NEARER[shown] - depth[FACES[shown]].mean(axis=1), kind="stable")]
    fixed = _fixed((outline[order] - (left, top)) * _FINE - 0.5)
    canvas = np.zeros((height * _FINE, width * _FINE, 4), dtype=np.uint8)
    for face, ink in zip(fixed, inks[order].tolist(), strict=True):
        cv2.fillConvexPoly(canvas, face, ink, cv2.LINE_8, _SHIFT)
    patch = cv2.resize(canvas, (width, height), interpolation=cv2.INTER_AREA)
    return Figure(left, top, np.asarray(patch, dtype=np.uint8))


def _fixed(points: Floats) -> NDArray[np.int32]:
    return np.rint(points * (1 << _SHIFT)).astype(np.int32)
