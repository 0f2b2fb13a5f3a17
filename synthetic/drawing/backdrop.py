"""The empty room in one camera's image: ray-cast once, reused for every frame."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera
from synthetic.drawing.ray_casting import FAR, hit_distances_and_normals, may_intersect
from synthetic.room import house_surfaces
from synthetic.room.room import Block, Door, Room
from synthetic.room.surface_styles import surface_color, surface_style

_FINE = 2  # rays per pixel and direction
_BAND = 24  # image rows cast at a time, to limit memory
_CORRIDOR = 1.5  # meters from a doorway to the wall behind it
_FLOOR, _DOOR, _PIECE = 1, 2, 16  # labels: the floor, the first door, the first piece of furniture
_RAISED = 1.0  # meters above the floor from which furniture does not darken it
_SUN = np.array([-0.55, -0.45, 0.70])  # towards the light

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Backdrop:
    """The empty room in one camera's image, with masks. Shares are 0..255."""

    image: Bytes  # (H, W, 3) blue, green, red
    floor: Bytes  # (H, W) share of a pixel that is bare floor, where shadows fall
    doors: tuple[Bytes, ...]  # (H, W) each: share that is doorway
    furniture: tuple[Bytes, ...]  # (H, W) each: share that the furniture covers


def paint_backdrop(room: Room, view: PinholeCamera) -> Backdrop:
    """Ray-cast the empty room; about a second for 640 x 360."""
    image = np.empty((view.height, view.width, 3), dtype=np.uint8)
    kinds = [_FLOOR]
    kinds += [_DOOR + index for index in range(len(room.doors))]
    kinds += [_PIECE + index for index in range(len(room.furniture))]
    shares = np.empty((len(kinds), view.height, view.width), dtype=np.uint8)
    columns = (np.arange(view.width * _FINE) + 0.5) / _FINE
    for top in range(0, view.height, _BAND):
        bottom = min(top + _BAND, view.height)
        rows = top + (np.arange((bottom - top) * _FINE) + 0.5) / _FINE
        rays = view.ray_grid(columns, rows)
        color, label = _cast(room, view.center, rays.reshape(-1, 3))
        size = (view.width, bottom - top)
        fine = np.clip(color[:, ::-1] * 255, 0, 255).astype(np.float32).reshape(rays.shape)
        image[top:bottom] = np.rint(cv2.resize(fine, size, interpolation=cv2.INTER_AREA)).astype(np.uint8)
        for kind, share in zip(kinds, shares, strict=True):
            mask = ((label == kind) * np.float32(255)).reshape(rays.shape[:2])
            share[top:bottom] = np.rint(cv2.resize(mask, size, interpolation=cv2.INTER_AREA)).astype(np.uint8)
    doors = len(room.doors)
    return Backdrop(image, shares[0], tuple(shares[1 : 1 + doors]), tuple(shares[1 + doors :]))


def _cast(room: Room, origin: Floats, rays: Floats) -> tuple[Floats, NDArray[np.int32]]:
    color, label, distance = _shell(room, origin, rays)
    for index, piece in enumerate(room.furniture):
        for block in piece.blocks:
            near = np.flatnonzero(may_intersect(block, origin, rays))
            reach, normal = hit_distances_and_normals(block, origin, rays[near])
            nearer = reach < distance[near]
            chosen = near[nearer]
            distance[chosen] = reach[nearer]
            points = origin + rays[chosen] * reach[nearer, None]
            color[chosen] = _lit(room, block, points, normal[nearer])
            label[chosen] = _PIECE + index
    return color, label


def _shell(room: Room, origin: Floats, rays: Floats) -> tuple[Floats, NDArray[np.int32], Floats]:
    """Intersect rays with the floor, ceiling and walls, and with the corridors behind the doorways."""
    far = np.array([room.width, room.depth, room.height])
    safe = np.where(np.abs(rays) < 1e-9, 1e-9, rays)  # noqa: PLR2004 — a ray along a wall
    planes = np.where(safe > 0, far - origin, -origin) / safe
    side = planes.argmin(axis=1)
    distance = planes.min(axis=1)
    points = origin + rays * distance[:, None]
    color = np.zeros_like(rays)
    label = np.zeros(len(rays), dtype=np.int32)
    for axis in range(3):
        for upper in (False, True):
            mask = (side == axis) & ((rays[:, axis] > 0) == upper)
            color[mask] = surface_color(room, points[mask], axis, upper=upper)
    ground = (side == 2) & (rays[:, 2] < 0)  # noqa: PLR2004 — the z axis
    color[ground] *= _contact(room, points[ground])[:, None]
    label[ground] = _FLOOR
    for index, door in enumerate(room.doors):
        axis = 1 if door.wall == "north" else 0
        along = points[:, 1 - axis] - door.start
        wall = (side == axis) & (rays[:, axis] > 0)
        rim = wall & (along > -0.09) & (along < door.width + 0.09) & (points[:, 2] < door.height + 0.09)  # noqa: PLR2004 — frame of 9 cm
        color[rim] = np.array([0.66, 0.65, 0.63]) * 0.92
        through = wall & (along > 0) & (along < door.width) & (points[:, 2] < door.height)
        color[through] = _behind(room, door, origin, rays[through])
        label[through] = _DOOR + index
    return color, label, distance


def _behind(room: Room, door: Door, origin: Floats, rays: Floats) -> Floats:
    axis, edge = (1, room.depth) if door.wall == "north" else (0, room.width)
    jambs = np.where(rays[:, 1 - axis] > 0, door.start + door.width, door.start)
    to_jamb = (jambs - origin[1 - axis]) / np.where(rays[:, 1 - axis] == 0, 1e-9, rays[:, 1 - axis])
    beyond_jamb = origin[axis] + rays[:, axis] * to_jamb - edge
    to_floor = np.where(rays[:, 2] < 0, -origin[2] / np.minimum(rays[:, 2], -1e-9), FAR)
    to_back = (edge + _CORRIDOR - origin[axis]) / np.maximum(rays[:, axis], 1e-9)
    reach = np.minimum(to_floor, to_back)
    reach = np.where((beyond_jamb > 0) & (beyond_jamb < 0.15), np.minimum(reach, to_jamb), reach)  # noqa: PLR2004 — wall thickness
    points = origin + rays * reach[:, None]
    points[:, 2] = np.where(np.abs(points[:, 2]) < 1e-6, 0.0, points[:, 2])  # noqa: PLR2004 — rounding
    return house_surfaces.corridor_color(points, points[:, axis] - edge)


def _contact(room: Room, points: Floats) -> Floats:
    """Darken the floor close to and beneath furniture."""
    shade = np.ones(len(points))
    for piece in room.furniture:
        if min(block.low[2] for block in piece.blocks) > _RAISED:
            continue
        west, south, east, north = piece.footprint
        dx = np.maximum(np.maximum(west - points[:, 0], points[:, 0] - east), 0)
        dy = np.maximum(np.maximum(south - points[:, 1], points[:, 1] - north), 0)
        shade *= 1 - 0.36 * np.exp(-np.hypot(dx, dy) / 0.16)
    return shade


def _lit(room: Room, block: Block, points: Floats, normals: Floats) -> Floats:
    sun = _SUN / np.linalg.norm(_SUN)
    diffuse = 0.62 + 0.26 * np.clip(normals @ sun, -0.5, 1) + 0.20 * np.clip(normals[:, 2], 0, 1)
    low = 1 - 0.25 * np.exp(-np.maximum(points[:, 2], 0) / 0.2)
    level = surface_style(room).light(room, points[:, 0], points[:, 1])
    leaf = house_surfaces.hash_noise(
        np.floor(points[:, 0] * 28), np.floor(points[:, 1] * 28 + points[:, 2] * 31)
    )
    grain = 0.72 + 0.56 * leaf if block.shape == "ball" else np.ones(len(points))
    color: Floats = np.array(block.color) * (diffuse * low * level * grain * 1.15)[:, None]
    return color
