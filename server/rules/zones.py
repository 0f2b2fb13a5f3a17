"""Zones: areas and lines on the floor or in one camera's picture, and where points are relative to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Area:
    """A polygon.

    Attributes:
        name: its id.
        corners: three or more, in order; the polygon may be concave.
        camera: in pixels of this camera's own picture; None: on the floor.
        margin: distance outside the border at which someone has left, in the same unit.
        hold: frames for which a change must last.
        absent: frames unseen after which someone has left.
    """

    name: str
    corners: tuple[Point, ...]
    camera: str | None = None
    margin: float = 0.0
    hold: int = 0
    absent: int = 1

    def depth(self, point: Point) -> float:
        """Return the distance of a point to the border: positive inside, negative outside."""
        x, y = point
        nearest, inside = float("inf"), False
        before = self.corners[-1]
        for corner in self.corners:
            nearest = min(nearest, _distance(point, before, corner))
            # Ray casting to the right; half-open edges count a corner once.
            if (before[1] > y) != (corner[1] > y):
                at = before[0] + (y - before[1]) * (corner[0] - before[0]) / (corner[1] - before[1])
                inside ^= x < at
            before = corner
        return nearest if inside else -nearest

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """Return which of N points (N, 2) are inside, as :meth:`depth` tells it, all at once: (N,)."""
        x, y = points[:, 0], points[:, 1]
        inside = np.zeros(len(points), dtype=np.bool_)
        before = self.corners[-1]
        for corner in self.corners:
            if before[1] != corner[1]:
                at = before[0] + (y - before[1]) * (corner[0] - before[0]) / (corner[1] - before[1])
                inside ^= ((before[1] > y) != (corner[1] > y)) & (x < at)
            before = corner
        return inside


@dataclass(frozen=True, slots=True)
class Line:
    """A line from one point to another, with a direction: inward is to the side of a third point.

    Attributes:
        name: its id.
        ends: the two ends.
        inner: a point on the inner side.
        camera: in pixels of this camera's own picture; None: on the floor.
        margin: distance beyond the line at which someone has crossed it, in the same unit.
        hold: frames for which they must stay beyond it.
        absent: frames unseen after which someone's side is forgotten.
    """

    name: str
    ends: tuple[Point, Point]
    inner: Point
    camera: str | None = None
    margin: float = 0.0
    hold: int = 0
    absent: int = 1

    def depth(self, point: Point) -> float:
        """Return the distance of a point to the line without its ends: positive on the inner side."""
        (x, y), (x2, y2) = self.ends
        side = np.sign(_cross(self.ends[0], self.ends[1], self.inner))
        return float(side * _cross(self.ends[0], self.ends[1], point) / np.hypot(x2 - x, y2 - y))

    def crossed_by(self, start: Point, end: Point) -> bool:
        """Return whether a step passes between the two ends; a point on the line is on the inner side."""
        if (self.depth(start) >= 0.0) == (self.depth(end) >= 0.0):
            return False
        return (_cross(start, end, self.ends[0]) > 0.0) != (_cross(start, end, self.ends[1]) > 0.0)


Zone = Area | Line


def _cross(origin: Point, to: Point, point: Point) -> float:
    """Return the cross product of two vectors from an origin: its sign is the point's side."""
    return (to[0] - origin[0]) * (point[1] - origin[1]) - (to[1] - origin[1]) * (point[0] - origin[0])


def _distance(point: Point, start: Point, end: Point) -> float:
    """Return the distance of a point to a segment."""
    across, down = end[0] - start[0], end[1] - start[1]
    x, y = point[0] - start[0], point[1] - start[1]
    length = across * across + down * down
    share = 0.0 if length == 0.0 else min(1.0, max(0.0, (x * across + y * down) / length))
    return float(np.hypot(x - share * across, y - share * down))
