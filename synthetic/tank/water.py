"""Light under water: absorption by distance, caustics on the ground, and shafts of sunlight.

Colors are red, green, blue in 0..1.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera

_MURK = np.array([0.125, 0.088, 0.084])  # absorption per meter
_DEEP = np.array([0.035, 0.205, 0.265])
_SHALLOW = np.array([0.30, 0.62, 0.63])
TILE = 128  # pixels of the caustics, which repeat
_TILE_METERS = 2.6
_RAYS = 208  # in a row of the grid that generates the caustics
_WAVES = ((1, 2), (2, -1), (-2, 2), (3, 1), (-1, 3), (2, 3), (4, -2), (-3, 3), (1, -5), (5, 2))  # per tile
_STEEP = 0.115  # steepness of the longest waves
_SPEED = 0.115  # turns per second of a wave as long as a tile; longer waves turn more slowly
_SOFT = 1.1  # pixels: blur by the size of the sun
_SHADE, _LINES = 0.45, 95.0  # light that counts as shade, and gray levels per unit of light above it
_COARSE = 16  # shafts are soft, so they are drawn at a sixteenth of the size
_SHAFTS = (
    (9.0, 0.31, 0.0),
    (15.0, -0.43, 2.1),
    (23.0, 0.57, 4.4),
)  # per radian; turns per second x 2 pi; phase

Bytes = NDArray[np.uint8]


def attenuate_by_water(colors: Floats, meters: Floats, water: Floats) -> Floats:
    """Attenuate colors ``(..., 3)`` over ``meters`` ``(...)`` towards the water's color ``(..., 3)``."""
    transmitted = np.exp(-_MURK * meters[..., None])
    attenuated: Floats = colors * transmitted + water * (1 - transmitted)
    return attenuated


def transmittance(meters: Floats) -> Floats:
    """Return the share of light ``(..., 3)`` that remains after ``meters`` ``(...)`` of water."""
    transmitted: Floats = np.exp(-_MURK * meters[..., None])
    return transmitted


def open_water(rays: Floats) -> Floats:
    """Return the color ``(..., 3)`` of open water in the directions of unit vectors ``(..., 3)``."""
    rise = np.clip((rays[..., 2] + 0.34) / 0.72, 0, 1)
    share = (rise * rise * (3 - 2 * rise))[..., None]
    water: Floats = _DEEP + (_SHALLOW - _DEEP) * share
    return water


@lru_cache(maxsize=1)
def _waves() -> tuple[Floats, NDArray[np.float32], NDArray[np.float32]]:
    """Return the waves W of the surface: their turns (W,) per second, and slopes on a grid of rays.

    The slopes ``(2 W, 2 R)`` are towards x and y side by side, at the beginning and a quarter turn later; the
    rays' positions ``(2, R)`` are in pixels of the caustics. All of it repeats from tile to tile.
    """
    rng = np.random.default_rng(0xCA57)
    axis = np.arange(_RAYS) * (2 * np.pi / _RAYS)
    x, y = (part.ravel() for part in np.meshgrid(axis, axis))
    turns, slopes = [], []
    for along, across in _WAVES:
        length = float(np.hypot(along, across))
        turns.append(_SPEED * length**0.5 * float(rng.choice([-1, 1])))
        phase = along * x + across * y + rng.uniform(0, 2 * np.pi)
        height = _STEEP / length**1.6 * TILE / (2 * np.pi)
        slopes += [
            np.concatenate([part * height * along, part * height * across])
            for part in (np.cos(phase), -np.sin(phase))
        ]
    grid = np.stack([x, y]) * (TILE / (2 * np.pi))
    return np.array(turns), np.array(slopes, dtype=np.float32), grid.astype(np.float32)


@lru_cache(maxsize=2)
def caustics(seconds: float) -> Bytes:
    """Return the caustics ``(TILE, TILE)`` at a moment: 0 is shade, 255 the brightest line.

    Rays through a grid on the surface are refracted by the waves' slopes; many rays make a bright point.
    """
    turns, slopes, grid = _waves()
    angles = 2 * np.pi * turns * seconds
    now = np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32).ravel()
    # A tile is added so that truncation rounds down everywhere.
    column, row = (np.einsum("w,wr->r", now, slopes).reshape(2, -1) + grid + TILE).astype(np.int32) % TILE
    rays = np.bincount(row * TILE + column, minlength=TILE * TILE).reshape(TILE, TILE)
    tiled = np.pad(rays.astype(np.float32) * (TILE / _RAYS) ** 2, 4, mode="wrap")
    light = cv2.GaussianBlur(tiled, (0, 0), _SOFT)[4:-4, 4:-4]
    return np.asarray(np.clip((light - _SHADE) * _LINES, 0, 255), dtype=np.uint8)


def caustic_pixels(points: Floats) -> Floats:
    """Return the pixels ``(..., 2)`` of the caustics, not wrapped, for world points ``(..., 3)``.

    The sun is not vertical: light moves sideways as it falls.
    """
    meters = points[..., :2] + points[..., 2:] * np.array([0.25, 0.12])
    pixels: Floats = meters * (TILE / _TILE_METERS)
    return pixels


class LightShafts:
    """Shafts of sunlight in one camera's image."""

    def __init__(self, view: PinholeCamera) -> None:
        self._size = (view.width, view.height)
        width, height = max(view.width // _COARSE, 2), max(view.height // _COARSE, 2)
        x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        # They start at a point above the image and fade downwards.
        self._slant = np.arctan2(x - 0.38, y + 0.75)
        self._fade = np.clip(1.05 - y, 0, 1) ** 1.3 * np.exp(-(((x - 0.40) / 0.55) ** 2))

    def at(self, seconds: float) -> Bytes:
        """Return the light ``(H, W, 3)``, blue, green, red, that shafts add to the image."""
        waves = [np.sin(rate * 4 * self._slant + turn * seconds + phase) for rate, turn, phase in _SHAFTS]
        glow = np.clip(0.35 + sum(waves) / 3, 0, 1) ** 1.5 * self._fade
        light = (glow[..., None] * np.array([0.155, 0.165, 0.13]) * 255).astype(np.float32)
        whole = cv2.resize(light, self._size, interpolation=cv2.INTER_CUBIC)
        return np.asarray(np.clip(whole, 0, 255), dtype=np.uint8)
