"""Ray casting: intersections of rays with blocks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.room.room import Block

FAR = 1e9  # a ray's distance, meters, where it hits nothing


def _slabs(low: Floats, high: Floats, origin: Floats, rays: Floats) -> tuple[Floats, Floats]:
    inverse = 1.0 / np.where(np.abs(rays) < 1e-9, 1e-9, rays)  # noqa: PLR2004 — a ray along a face
    first, second = (low - origin) * inverse, (high - origin) * inverse
    enter, leave = np.minimum(first, second), np.maximum(first, second)
    axis = enter.argmax(axis=1)
    distance = enter.max(axis=1)
    missed = (distance > leave.min(axis=1)) | (distance <= 0)
    normal = np.zeros_like(rays)
    rows = np.arange(len(rays))
    normal[rows, axis] = -np.sign(rays[rows, axis])
    return np.where(missed, FAR, distance), normal


def _quadric(block: Block, origin: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """Intersect rays with the ellipsoid, or the cylinder with its lid, that touches the block's faces."""
    low, high = np.array(block.low), np.array(block.high)
    radii, center = (high - low) / 2, (high + low) / 2
    weight = np.array([1.0, 1.0, 1.0 if block.shape == "ball" else 0.0]) / radii**2
    offset = origin - center
    a = (rays**2 * weight).sum(axis=1)
    b = (rays * offset * weight).sum(axis=1)
    root = b * b - a * ((offset**2 * weight).sum() - 1.0)
    distance = np.where(root < 0, FAR, (-b - np.sqrt(np.maximum(root, 0))) / a)
    point = offset + rays * distance[:, None]
    normal = point * weight
    if block.shape == "cylinder":
        distance = np.where(np.abs(point[:, 2]) > radii[2], FAR, distance)
        distance, normal = _lid(distance, normal, offset, rays, radii)
    length = np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    return np.where(distance <= 0, FAR, distance), normal / length


def _lid(
    distance: Floats, normal: Floats, offset: Floats, rays: Floats, radii: Floats
) -> tuple[Floats, Floats]:
    top = (radii[2] - offset[2]) / np.minimum(rays[:, 2], -1e-9)
    point = offset + rays * top[:, None]
    inside = (point[:, 0] ** 2 + point[:, 1] ** 2 < radii[0] ** 2) & (top < distance) & (top > 0)
    up = np.array([0.0, 0.0, 1.0])
    return np.where(inside, top, distance), np.where(inside[:, None], up, normal)


def hit_distances_and_normals(block: Block, origin: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """Return each ray's distance ``(N,)``, `FAR` if missed, and the outward normal ``(N, 3)`` of its hit."""
    if block.shape == "box":
        return _slabs(np.array(block.low), np.array(block.high), origin, rays)
    return _quadric(block, origin, rays)


def may_intersect(block: Block, origin: Floats, rays: Floats) -> NDArray[np.bool_]:
    """Return which rays may hit a block: the cheap test before the exact one."""
    low, high = np.array(block.low), np.array(block.high)
    toward = (low + high) / 2 - origin
    along = rays @ toward
    reach = float(((high - low) ** 2).sum()) / 4  # of the ball around the block, squared
    near: NDArray[np.bool_] = toward @ toward - along * along <= reach
    if toward @ toward > reach:
        near &= along > 0
    return near
