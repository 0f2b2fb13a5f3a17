"""Sand, rocks and water in one camera's image: ray-cast once, under moving light."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera
from synthetic.drawing.ray_casting import FAR, hit_distances_and_normals, may_intersect
from synthetic.room.house_surfaces import hash_noise
from synthetic.room.room import Block
from synthetic.tank.water import (
    TILE,
    Bytes,
    LightShafts,
    attenuate_by_water,
    caustic_pixels,
    caustics,
    open_water,
    transmittance,
)

_FINE = 2  # rays per pixel and direction
_SAND = np.array([0.74, 0.66, 0.49])
_STONE = (0.34, 0.33, 0.31)
_SUN = np.array([0.22, -0.30, 0.93])  # towards the light
_CAUSTIC_GAIN = 1.9  # brightness of caustics relative to the shade
_FADING = 6.0  # meters from which caustic lines are too fine to be resolved


def _rock(x: float, y: float, wide: float, deep: float, high: float) -> Block:
    return Block((x - wide, y - deep, -high), (x + wide, y + deep, high), _STONE, "ball")


ROCKS = (
    (_rock(1.15, 1.5, 0.55, 0.4, 0.42), _rock(1.6, 1.35, 0.35, 0.3, 0.26), _rock(0.75, 1.75, 0.35, 0.3, 0.3)),
    (_rock(4.35, 2.9, 0.6, 0.45, 0.55), _rock(4.9, 2.7, 0.4, 0.35, 0.34)),
    (_rock(2.9, 4.3, 0.7, 0.4, 0.6), _rock(2.35, 4.15, 0.4, 0.3, 0.36)),
    (_rock(5.3, 0.7, 0.4, 0.3, 0.24), _rock(5.0, 0.55, 0.22, 0.2, 0.15)),
)


@dataclass(frozen=True, slots=True)
class RockOutline:
    """A heap of rocks in the image, which hides objects behind it."""

    distance: float  # meters from the camera
    area: tuple[slice, slice]
    share: Bytes  # (h, w) of the area: covered share of each pixel


class Seabed:
    """The static parts of a camera's image, under moving light."""

    def __init__(self, view: PinholeCamera) -> None:
        columns = (np.arange(view.width * _FINE) + 0.5) / _FINE
        rows = (np.arange(view.height * _FINE) + 0.5) / _FINE
        shape = (len(rows), len(columns))
        rays = view.ray_grid(columns, rows).reshape(-1, 3)
        cast = _cast(view.center, rays)
        water = open_water(rays)
        color = attenuate_by_water(cast.color, cast.distance, water)
        color[~cast.solid] = water[~cast.solid]
        gain = (
            cast.color
            * transmittance(cast.distance)
            * (_CAUSTIC_GAIN / (1 + (cast.distance / _FADING) ** 4))[:, None]
        )
        gain *= cast.level[:, None] * cast.solid[:, None]
        size = (view.width, view.height)
        self._base, self._gain = (_shrink(part, shape, size) for part in (color, gain))
        self._shafts = LightShafts(view)
        self.rocks = tuple(
            rock
            for index, heap in enumerate(ROCKS)
            if (rock := _outline(view, heap, (cast.label == index + 1).reshape(shape), size)) is not None
        )
        ground = np.flatnonzero(self._gain.any(axis=(1, 2)))
        self._rows = slice(int(ground[0]), int(ground[-1]) + 1) if len(ground) else slice(0, 0)
        points = view.center + rays * np.where(cast.solid, cast.distance, 0)[:, None]
        where = caustic_pixels(points).reshape(*shape, 2)[_FINE // 2 :: _FINE, _FINE // 2 :: _FINE][
            self._rows
        ]
        # Wrapped once here, which is several times faster than wrapping in remap.
        column, row = np.moveaxis(where % TILE, -1, 0).astype(np.float32)
        self._places, self._between = cv2.convertMaps(column, row, cv2.CV_16SC2)

    def lit(self, seconds: float) -> Bytes:
        """Return the seabed's BGR image ``(H, W, 3)`` in the light of a moment."""
        image = np.asarray(cv2.add(self._base, self._shafts.at(seconds)), dtype=np.uint8)
        if self._rows.stop:
            tile = cv2.copyMakeBorder(caustics(seconds), 0, 1, 0, 1, cv2.BORDER_WRAP)
            net = cv2.remap(
                tile, self._places, self._between, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )
            glow = cv2.multiply(self._gain[self._rows], cv2.merge([net, net, net]), scale=1 / 255)
            image[self._rows] = cv2.add(image[self._rows], glow)
        return image


@dataclass(frozen=True, slots=True)
class _Cast:
    color: Floats  # (R, 3) in the shade, without water in front
    level: Floats  # (R,) share of the sunlight
    distance: Floats  # (R,) meters
    solid: NDArray[np.bool_]  # (R,)
    label: NDArray[np.int32]  # (R,) 0: sand or water; rocks from 1


def _cast(origin: Floats, rays: Floats) -> _Cast:
    down = rays[:, 2] < -1e-3  # noqa: PLR2004 — level rays never hit the sand
    distance = np.where(down, -origin[2] / np.minimum(rays[:, 2], -1e-3), FAR)
    solid = distance < 60.0  # noqa: PLR2004 — meters of water are opaque
    color = np.zeros_like(rays)
    points = origin + rays * np.where(solid, distance, 0)[:, None]
    color[solid] = _sand(points[solid])
    level = np.where(solid, 1.0, 0.0)
    label = np.zeros(len(rays), dtype=np.int32)
    sun = _SUN / np.linalg.norm(_SUN)
    for index, heap in enumerate(ROCKS):
        for block in heap:
            near = np.flatnonzero(may_intersect(block, origin, rays))
            reach, normal = hit_distances_and_normals(block, origin, rays[near])
            nearer = (reach < distance[near]) & (reach < FAR)
            chosen = near[nearer]
            place = origin + rays[chosen] * reach[nearer, None]
            light = np.clip(normal[nearer] @ sun, 0, 1)
            color[chosen] = _stone(place) * (0.42 + 0.58 * light)[:, None]
            level[chosen], distance[chosen], solid[chosen], label[chosen] = (
                light,
                reach[nearer],
                True,
                index + 1,
            )
    return _Cast(color, level, distance, solid, label)


def _sand(points: Floats) -> Floats:
    """Color sand points ``(N, 3)``: ripples, grains, and shade beside the rocks."""
    x, y = points[:, 0], points[:, 1]
    bend = 0.35 * np.sin(1.3 * x + 0.7 * np.sin(0.9 * y)) + 0.12 * np.sin(3.1 * x + 1.0)
    ripple = 0.05 * np.sin(13.0 * (y + bend)) + 0.03 * np.sin(5.0 * (y + 0.4 * x))
    grain = 0.07 * (hash_noise(np.floor(x * 55), np.floor(y * 55)) - 0.5)
    shade = np.ones(len(points))
    for heap in ROCKS:
        for rock in heap:
            middle = (np.array(rock.low) + np.array(rock.high)) / 2
            radii = (np.array(rock.high) - np.array(rock.low)) / 2
            off = np.hypot((x - middle[0] + 0.08) / radii[0], (y - middle[1] + 0.1) / radii[1])
            shade *= 1 - 0.5 * np.exp(-(np.maximum(off - 0.9, 0) ** 2) / 0.12)
    color: Floats = _SAND * ((0.72 + ripple + grain) * shade)[:, None]
    return color


def _stone(points: Floats) -> Floats:
    """Color points ``(N, 3)`` of rocks: gray, with moss on some of it."""
    x, y, z = points.T
    patch = 0.5 + 0.5 * np.sin(7 * x + 3 * np.sin(5 * y)) * np.sin(6 * y + 4 * z + 2 * np.sin(8 * x))
    grain = 0.88 + 0.24 * hash_noise(np.floor(x * 34), np.floor(y * 34 + z * 41))
    moss = np.array([0.22, 0.33, 0.19])
    color: Floats = (np.array(_STONE) + (moss - np.array(_STONE)) * patch[:, None] ** 2) * grain[:, None]
    return color


def _shrink(color: Floats, shape: tuple[int, int], size: tuple[int, int]) -> Bytes:
    fine = np.clip(color[:, ::-1] * 255, 0, 255).astype(np.float32).reshape(*shape, 3)
    return np.asarray(np.rint(cv2.resize(fine, size, interpolation=cv2.INTER_AREA)), dtype=np.uint8)


def _outline(
    view: PinholeCamera, heap: tuple[Block, ...], mask: NDArray[np.bool_], size: tuple[int, int]
) -> RockOutline | None:
    share = np.rint(cv2.resize(mask * np.float32(255), size, interpolation=cv2.INTER_AREA)).astype(np.uint8)
    x, y, width, height = cv2.boundingRect(share)
    if not width:
        return None
    middle = np.mean([(np.array(block.low) + np.array(block.high)) / 2 for block in heap], axis=0)
    distance = float(np.linalg.norm(middle - view.center))
    return RockOutline(
        distance, (slice(y, y + height), slice(x, x + width)), share[y : y + height, x : x + width]
    )
