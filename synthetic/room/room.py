"""The room: its measures, doors, furniture and camera places, in metres.

x runs east, y north, z up; the floor's south-west corner is the origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np

from synthetic.cameras.pinhole import Floats, Viewpoint

Colour: TypeAlias = tuple[float, float, float]  # red, green, blue in 0..1
Point: TypeAlias = tuple[float, float]
Style: TypeAlias = Literal["house", "court"]


@dataclass(frozen=True, slots=True)
class Block:
    """An upright box, or the upright cylinder or ball that fits inside it."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    colour: Colour
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
    """Everything in a room that does not move. A room equals only itself: quick to remember things by."""

    width: float  # west to east
    depth: float  # south to north
    height: float
    doors: tuple[Door, ...]
    furniture: tuple[Furniture, ...]
    rug: tuple[float, float, float, float]  # west, south, east and north bound
    viewpoints: tuple[Viewpoint, ...]
    style: Style = "house"  # what floor, walls and light are like: finish.py

    def beyond(self, door: Door, along: float, out: float) -> Point:
        """Give the floor point `out` metres beyond a door's wall, `along` from the opening's middle."""
        middle = door.start + door.width / 2 + along
        return (middle, self.depth + out) if door.wall == "north" else (self.width + out, middle)

    def footprints(self) -> Floats:
        """Give the furniture's bounds on the floor: ``(F, 4)`` west, south, east, north."""
        return _footprints(self)

    def outside(self, x: float, y: float) -> float:
        """Say how far beyond the walls a floor point lies; negative inside."""
        return max(-x, -y, x - self.width, y - self.depth)


@lru_cache(maxsize=8)
def _footprints(room: Room) -> Floats:
    return np.array([piece.footprint for piece in room.furniture]).reshape(-1, 4)


_PLASTER = (0.74, 0.72, 0.69)
_OAK = (0.40, 0.29, 0.20)
_LEAF = ((0.20, 0.33, 0.20), (0.24, 0.40, 0.23), (0.17, 0.29, 0.19))


def bench(x: float, y: float) -> Furniture:
    """Give a bench along the southern wall, by its south-western corner."""
    legs = (0.10, 1.32)
    return Furniture(
        "bench",
        (
            Block((x, y, 0.38), (x + 1.5, y + 0.42, 0.45), _OAK),
            *(
                Block((x + at, y + 0.05, 0.0), (x + at + 0.08, y + 0.37, 0.38), (0.16, 0.16, 0.17))
                for at in legs
            ),
        ),
    )


def plant(x: float, y: float) -> Furniture:
    """Give a plant in a pot, by its middle."""
    balls = ((0, 0, 1.0, 0.30), (0.17, 0.06, 0.82, 0.22), (-0.16, 0.1, 0.86, 0.23), (0.02, -0.17, 0.8, 0.22))
    leaves = tuple(
        Block(
            (x + dx - r, y + dy - r, z - r),
            (x + dx + r, y + dy + r, z + r * 1.25),
            _LEAF[index % len(_LEAF)],
            "ball",
        )
        for index, (dx, dy, z, r) in enumerate(balls)
    )
    pot = Block((x - 0.2, y - 0.2, 0.0), (x + 0.2, y + 0.2, 0.5), (0.66, 0.62, 0.57), "cylinder")
    return Furniture("plant", (pot, *leaves))


def sofa(x: float, y: float) -> Furniture:
    """Give a sofa along the western wall, by its south-western corner."""
    cloth, cushion = (0.25, 0.31, 0.38), (0.30, 0.37, 0.44)
    return Furniture(
        "sofa",
        (
            Block((x, y, 0.08), (x + 0.85, y + 2.1, 0.30), cloth),
            Block((x, y, 0.30), (x + 0.22, y + 2.1, 0.82), cloth),
            Block((x, y, 0.30), (x + 0.85, y + 0.2, 0.58), cloth),
            Block((x, y + 1.9, 0.30), (x + 0.85, y + 2.1, 0.58), cloth),
            Block((x + 0.22, y + 0.22, 0.30), (x + 0.83, y + 1.04, 0.44), cushion),
            Block((x + 0.22, y + 1.06, 0.30), (x + 0.83, y + 1.88, 0.44), cushion),
        ),
    )


def sideboard(x: float, y: float) -> Furniture:
    """Give a sideboard along the eastern wall, by its south-western corner."""
    doors = tuple(
        Block((x - 0.015, y + 0.03 + 0.6 * k, 0.16), (x, y + 0.57 + 0.6 * k, 0.72), (0.47, 0.35, 0.25))
        for k in range(3)
    )
    return Furniture("sideboard", (Block((x, y, 0.12), (x + 0.42, y + 1.8, 0.76), _OAK), *doors))


def _pillar(x: float, y: float, height: float) -> Furniture:
    return Furniture(
        "pillar",
        (
            Block((x, y, 0.0), (x + 0.3, y + 0.3, height), _PLASTER),
            Block((x - 0.02, y - 0.02, 0.0), (x + 0.32, y + 0.32, 0.1), (0.5, 0.49, 0.47)),
        ),
    )


ROOM = Room(
    width=11.0,
    depth=8.0,
    height=3.4,
    doors=(Door("north", 7.75), Door("east", 5.45)),
    # Along the walls and beneath the cameras, where nobody wants to go; only the pillar stands in the room.
    furniture=(
        _pillar(5.6, 6.0, 3.4),
        bench(4.75, 0.45),
        sofa(0.08, 2.95),
        sideboard(10.54, 2.3),
        plant(0.6, 0.6),
        plant(10.4, 0.6),
        plant(0.6, 7.4),
        plant(10.4, 7.4),
    ),
    rug=(3.7, 2.35, 7.3, 4.75),
    # Corners first: with two or three cameras the doorways are far from all of them, and before two.
    viewpoints=(
        Viewpoint((0.35, 0.35, 3.0), (5.6, 4.75, 0.45)),
        Viewpoint((10.65, 0.35, 3.0), (5.4, 4.75, 0.45)),
        Viewpoint((0.35, 7.65, 3.0), (5.6, 3.25, 0.45)),
        Viewpoint((10.65, 7.65, 3.0), (5.4, 3.25, 0.45)),
        Viewpoint((5.5, 0.25, 3.1), (5.5, 5.2, 0.45)),
        Viewpoint((2.9, 7.75, 3.1), (4.3, 2.8, 0.45)),
        Viewpoint((0.25, 4.0, 3.0), (6.0, 4.0, 0.45)),
        Viewpoint((10.75, 4.6, 3.0), (5.0, 3.9, 0.45)),
    ),
)
