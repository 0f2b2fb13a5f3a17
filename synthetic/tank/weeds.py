"""Weeds: clumps of blades that grow from the sand, sway, and hide fish behind them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera
from synthetic.drawing.figure import Figure
from synthetic.tank.water import attenuate_by_water, open_water

_JOINTS = 11  # of a blade
_SHARE = np.linspace(0, 1, _JOINTS)  # of the way up
_SWAY = 0.22  # meters at the tip of a blade of one meter
_CLUMPS = (  # x, y and height in meters
    (0.55, 0.8, 1.25),
    (1.75, 3.1, 1.55),
    (2.45, 1.0, 0.95),
    (3.55, 3.7, 1.85),
    (3.85, 1.9, 1.2),
    (5.25, 1.7, 1.5),
    (5.35, 4.1, 1.7),
    (0.65, 4.2, 1.9),
)
_BLADES = (6, 9)  # least in a clump, and upper bound (exclusive)
_GREENS = np.array([(0.16, 0.40, 0.15), (0.24, 0.46, 0.16), (0.34, 0.44, 0.14), (0.14, 0.33, 0.18)])
_TONES = (0.72, 1.12)  # of the shaded and of the lit half of a blade
_FINE = 2  # drawn pixels per pixel
_SHIFT = 4  # fractional bits of cv2's coordinates


@dataclass(frozen=True, slots=True, eq=False)
class _Meadow:
    """All blades B, clump after clump."""

    feet: Floats  # (B, 3) meters
    heights: Floats  # (B,) meters
    widths: Floats  # (B, _JOINTS) meters, half
    phases: Floats  # (B,) radians
    colors: Floats  # (B, 3) red, green, blue in 0..1
    clumps: tuple[slice, ...]


def _grow() -> _Meadow:
    rng = np.random.default_rng(0x3EED)
    taper = np.sqrt(np.clip(1 - _SHARE**2.2, 0, 1)) * (0.55 + 0.45 * np.minimum(_SHARE * 3, 1))
    parts: list[tuple[Floats, ...]] = []
    for x, y, height in _CLUMPS:
        count = int(rng.integers(*_BLADES))
        turn, off = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.02, 0.22, count)
        feet = np.column_stack([x + off * np.cos(turn), y + off * np.sin(turn), np.zeros(count)])
        heights = height * rng.uniform(0.55, 1.0, count)
        broad = rng.uniform(0.028, 0.05, count)
        phases = rng.uniform(0, 1.6, count) + x
        widths = broad[:, None] * taper * (1 + 0.18 * np.sin(9 * _SHARE + phases[:, None]))
        greens = _GREENS[rng.integers(len(_GREENS), size=count)] * rng.uniform(0.85, 1.15, (count, 1))
        parts.append((feet, heights, widths, phases, greens))
    ends = np.cumsum([0, *(len(part[0]) for part in parts)]).tolist()
    clumps = tuple(slice(first, last) for first, last in pairwise(ends))
    feet, heights, widths, phases, colors = (np.concatenate(column) for column in zip(*parts, strict=True))
    return _Meadow(feet, heights, widths, phases, colors, clumps)


_MEADOW = _grow()


@dataclass(frozen=True, slots=True)
class Clump:
    """A drawn clump, and its distance from the camera in meters."""

    distance: float
    figure: Figure


class Weeds:
    """The weeds in front of one camera."""

    def __init__(self, view: PinholeCamera) -> None:
        self._view = view
        centers = _MEADOW.feet + _MEADOW.heights[:, None] * np.array([0, 0, 0.5])
        sight = centers - view.center
        distance = np.linalg.norm(sight, axis=1)
        self._distances = [float(distance[clump].mean()) for clump in _MEADOW.clumps]
        # The farthest blades of a clump are drawn first.
        self._order = [np.arange(c.start, c.stop)[np.argsort(-distance[c])].tolist() for c in _MEADOW.clumps]
        water = open_water(sight / distance[:, None])
        self._inks = []
        for tone in _TONES:
            colors = np.clip(
                attenuate_by_water(_MEADOW.colors * tone, distance, water)[:, ::-1] * 255, 0, 255
            )
            self._inks.append(np.column_stack([colors, np.full(len(colors), 255.0)]).tolist())

    def at(self, seconds: float) -> list[Clump]:
        """Draw the swaying clumps at a moment; those not in front of the camera are left out."""
        spines = _spines(seconds)
        pixels, depth = self._view.project(spines.reshape(-1, 3))
        pixels, depth = pixels.reshape(*spines.shape[:2], 2), depth.reshape(spines.shape[:2])
        along = np.gradient(pixels, axis=1)
        across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        across /= np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-9)
        offsets = across * (_MEADOW.widths * self._view.focal / np.maximum(depth, 1e-6))[..., None]
        rims = np.stack([pixels - offsets, pixels, pixels + offsets])  # (3, B, _JOINTS, 2)
        return [
            Clump(distance, self._draw(rims[:, clump], order, clump.start))
            for clump, order, distance in zip(_MEADOW.clumps, self._order, self._distances, strict=True)
            if depth[clump].min() > 0.3  # noqa: PLR2004 — meters
        ]

    def _draw(self, rims: Floats, order: list[int], first: int) -> Figure:
        low, high = rims.min(axis=(0, 1, 2)), rims.max(axis=(0, 1, 2))
        left, top = (np.floor(low).astype(int) - 1).tolist()
        right, bottom = (np.ceil(high).astype(int) + 1).tolist()
        canvas = np.zeros(((bottom - top) * _FINE, (right - left) * _FINE, 4), dtype=np.uint8)
        fixed = _fixed((rims - (left, top)) * _FINE - 0.5)
        # From one rim up to the tip and back along the middle.
        halves = np.concatenate([fixed[:2], fixed[1:, :, ::-1]], axis=2)
        for blade in order:
            for half, inks in zip(halves, self._inks, strict=True):
                cv2.fillPoly(canvas, [half[blade - first]], inks[blade], cv2.LINE_8, _SHIFT)
        patch = cv2.resize(canvas, (right - left, bottom - top), interpolation=cv2.INTER_AREA)
        return Figure(left, top, np.asarray(patch, dtype=np.uint8))


def _spines(seconds: float) -> Floats:
    """Return the joints ``(B, _JOINTS, 3)`` of all blades, in meters."""
    reach = _SWAY * _MEADOW.heights[:, None] * _SHARE**1.6
    phase = _MEADOW.phases[:, None] - 2.4 * _SHARE
    x = reach * (np.sin(0.9 * seconds + phase) + 0.45 * np.sin(2.1 * seconds + 2 * phase))
    y = 0.6 * reach * np.sin(0.7 * seconds + phase + 1.0)
    spines: Floats = _MEADOW.feet[:, None] + np.stack([x, y, _MEADOW.heights[:, None] * _SHARE], axis=-1)
    return spines


def _fixed(points: Floats) -> NDArray[np.int32]:
    return np.rint(points * (1 << _SHIFT)).astype(np.int32)
