"""A room: size, doors, furniture and viewpoints, in meters.

x runs east, y north, z up; the floor's south-west corner is the origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np

from synthetic.cameras.pinhole import Floats, Viewpoint

Color: TypeAlias = tuple[float, float, float]  # red, green, blue in 0..1
Point: TypeAlias = tuple[float, float]
StyleName: TypeAlias = Literal["house", "court"]


@dataclass(frozen=True, slots=True)
class Block:
    """An upright box, or the upright cylinder or ball that fits inside it."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    color: Color
    shape: Literal["box", "cylinder", "ball"] = "box"


@dataclass(frozen=True, slots=True)
class Furniture:
    """A piece of furniture: the blocks that it is made of."""

    name: str
    blocks: tuple[Block, ...]

    @property
    def footprint(self) -> tuple[float, float, float, float]:
        """West, south, east and north bound on the floor."""
        return (
            min(block.low[0] for block in self.blocks),
            min(block.low[1] for block in self.blocks),
            max(block.high[0] for block in self.blocks),
            max(block.high[1] for block in self.blocks),
        )


@dataclass(frozen=True, slots=True)
class Door:
    """An open doorway in a wall; people come and go through it."""

    wall: Literal["north", "east"]
    start: float  # along the wall
    width: float = 1.15
    height: float = 2.2


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """The static parts of a room. Compared by identity, as a fast cache key."""

    width: float  # west to east
    depth: float  # south to north
    height: float
    doors: tuple[Door, ...]
    furniture: tuple[Furniture, ...]
    rug: tuple[float, float, float, float]  # west, south, east and north bound
    viewpoints: tuple[Viewpoint, ...]
    style: StyleName = "house"  # of floor, walls and light: surface_styles.py

    def beyond(self, door: Door, from_center: float, out: float) -> Point:
        """Return the floor point `out` meters beyond a door's wall, `from_center` meters along it."""
        middle = door.start + door.width / 2 + from_center
        return (middle, self.depth + out) if door.wall == "north" else (self.width + out, middle)

    def footprints(self) -> Floats:
        """Return the furniture's bounds on the floor: ``(F, 4)`` west, south, east, north."""
        return _footprints(self)

    def signed_distance_outside(self, x: float, y: float) -> float:
        """Return the distance of a floor point beyond the walls; negative inside."""
        return max(-x, -y, x - self.width, y - self.depth)


@lru_cache(maxsize=8)
def _footprints(room: Room) -> Floats:
    return np.array([piece.footprint for piece in room.furniture]).reshape(-1, 4)
