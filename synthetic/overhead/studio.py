"""The studio: a small room under a camera that looks straight down, as in Khalaf and Intille (2001)."""

from __future__ import annotations

from synthetic.cameras.pinhole import Viewpoint
from synthetic.room.room import Block, Furniture, Room, plant, sideboard, sofa

_WIDTH, _DEPTH = 7.0, 5.0  # metres
_HIGH = 6.0  # metres: from there the floor fills a picture of 16 by 9
_FIELD = 77.0  # degrees

FREE = (1.0, 1.0, 6.0, 4.0)  # west, south, east and north bound of where people go: no furniture stands there


def _table(x: float, y: float) -> Furniture:
    """Give a low round table with a bowl on it, by its middle."""
    return Furniture(
        "table",
        (
            Block((x - 0.06, y - 0.06, 0.0), (x + 0.06, y + 0.06, 0.4), (0.16, 0.16, 0.17), "cylinder"),
            Block((x - 0.36, y - 0.36, 0.4), (x + 0.36, y + 0.36, 0.44), (0.72, 0.66, 0.56), "cylinder"),
            Block((x - 0.13, y - 0.13, 0.42), (x + 0.13, y + 0.13, 0.56), (0.62, 0.40, 0.28), "ball"),
        ),
    )


def _desk(x: float, y: float) -> Furniture:
    """Give a desk along the northern wall with a screen and papers, by its south-western corner."""
    top = 0.74
    return Furniture(
        "desk",
        (
            Block((x, y, top - 0.04), (x + 1.6, y + 0.62, top), (0.46, 0.34, 0.24)),
            Block((x + 0.04, y + 0.05, 0.0), (x + 0.1, y + 0.6, top - 0.04), (0.2, 0.2, 0.21)),
            Block((x + 1.5, y + 0.05, 0.0), (x + 1.56, y + 0.6, top - 0.04), (0.2, 0.2, 0.21)),
            Block((x + 0.55, y + 0.42, top), (x + 1.15, y + 0.46, top + 0.4), (0.1, 0.11, 0.13)),
            Block((x + 0.62, y + 0.12, top), (x + 1.06, y + 0.26, top + 0.02), (0.24, 0.25, 0.27)),
            Block((x + 0.14, y + 0.14, top), (x + 0.35, y + 0.44, top + 0.01), (0.86, 0.85, 0.82)),
        ),
    )


OVERHEAD = Room(
    width=_WIDTH,
    depth=_DEPTH,
    height=_HIGH + 0.4,
    doors=(),
    furniture=(
        sofa(0.06, 1.45),
        _table(0.62, 0.62),
        sideboard(6.5, 1.6),
        _desk(2.2, 4.33),
        plant(0.5, 4.45),
        plant(6.5, 4.5),
        plant(6.5, 0.5),
    ),
    rug=(2.1, 1.45, 4.9, 3.55),
    viewpoints=(
        Viewpoint((_WIDTH / 2, _DEPTH / 2, _HIGH), (_WIDTH / 2, _DEPTH / 2, 0.0), _FIELD),
        Viewpoint((_WIDTH / 2 + 1.0, _DEPTH / 2, _HIGH), (_WIDTH / 2 + 1.0, _DEPTH / 2, 0.0), _FIELD),
    ),
)
